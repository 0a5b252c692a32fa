// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <nlohmann/json.hpp>
#include <string>

#include "program.hpp"
#include "raysplats/io.hpp"

namespace {

bool has(const std::string& text, const std::string& part) {
  return text.find(part) != std::string::npos;
}

nlohmann::json told(const std::string& path) {
  const Outcome outcome = raysplats_program({"info", path, "--json"});
  INFO(outcome.err);
  REQUIRE(outcome.code == 0);
  return nlohmann::json::parse(outcome.out);
}

}  // namespace

TEST_CASE("convert writes every format, which every command reads again") {
  const TemporaryFolder folder;
  write_file(folder / "balls.ply", ply_file(5));
  const auto convert = [&](std::vector<std::string> words) {
    words.insert(words.begin(), "convert");
    return raysplats_program(words);
  };
  for (const char* name : {"a.spz", "a.splat", "a.glb", "a.sog", "a.ply"}) {
    const Outcome outcome = convert({folder / "balls.ply", "-o", folder / name});
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    CHECK(has(outcome.out, "5 Gaussians, SH degree 0"));
    CHECK(has(outcome.out, name == std::string("a.ply") || name == std::string("a.glb")
                               ? "nothing is lost"
                               : "8 bits"));
    const nlohmann::json json = told(folder / name);
    CHECK(json.at("type") == "model");
    CHECK(json.at("gaussians") == 5);
  }
  CHECK(convert({folder / "a.glb", "-o", folder / "b.spz", "--spz-version", "4", "--sh-degree", "2",
                 "--rotate", "0,0,90"})
            .code == 0);
  CHECK(told(folder / "b.spz").at("sh_degree") == 2);
  const Outcome frames = raysplats_program(
      {"render", folder / "b.spz", "-o", folder / "frames", "--orbit", "1", "--width", "16", "-q"});
  INFO(frames.err);
  CHECK(frames.code == 0);
}

TEST_CASE("convert says in one sentence what it will not do") {
  const TemporaryFolder folder;
  write_file(folder / "balls.ply", ply_file(5));
  const auto refused = [&](const std::vector<std::string>& words, int code,
                           const std::string& part) {
    const Outcome outcome = raysplats_program(words);
    INFO(outcome.err);
    CHECK(outcome.code == code);
    CHECK(one_sentence(outcome));
    CHECK(has(outcome.err, part));
  };
  const std::string balls = folder / "balls.ply";
  refused({"convert", balls, "-o", folder / "a.obj"}, 2, ".splat");
  refused({"convert", balls, "-o", balls, "--overwrite"}, 2, "what is read");
  write_file(folder / "there.spz", "mine");
  refused({"convert", balls, "-o", folder / "there.spz"}, 2, "--overwrite");
  CHECK(read_file(folder / "there.spz") == "mine");
  refused({"convert", folder / "there.spz", "-o", folder / "b.ply"}, 3, "there.spz");
  refused({"convert", balls, "-o", folder / "a.spz", "--crop-min", "90,90,90"}, 2, "None of the 5");
  refused({"info", folder / "there.spz"}, 3, "there.spz");
  write_file(folder / "notes.txt", "hello");
  refused({"convert", folder / "notes.txt", "-o", folder / "b.ply"}, 3, "no model that is known");
}
