// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "io/zip_archive.hpp"
#include "program.hpp"
#include "raysplats/io.hpp"

namespace {

/// The files of a SOG beside each other, as other programs unpack them.
void unpack_sog(const std::string& archive, const std::filesystem::path& folder) {
  const std::string bytes = read_file(archive);
  const raysplats::io::ZipArchive zip(std::as_bytes(std::span(bytes)), archive);
  const auto unpack = [&](const std::string& name) {
    const std::vector<std::byte> content = zip.read(name);
    std::string text(reinterpret_cast<const char*>(content.data()), content.size());
    write_file(folder / name, text);
    return text;
  };
  for (const auto& part : nlohmann::json::parse(unpack("meta.json"))) {
    if (!part.is_object() || !part.contains("files")) continue;
    for (const auto& name : part.at("files")) unpack(name.get<std::string>());
  }
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
  for (const char* name : {"a.spz", "a.splat", "a.glb", "a.sog", "a.compressed.ply", "a.ply"}) {
    CAPTURE(name);
    const Outcome outcome = convert({folder / "balls.ply", "-o", folder / name});
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    CHECK(contains(outcome.out, "5 Gaussians, SH degree 0"));
    CHECK(contains(outcome.out, name == std::string("a.ply") || name == std::string("a.glb")
                                    ? "nothing is lost"
                                    : "8 bits"));
    const nlohmann::json json = told(folder / name);
    CHECK(json.at("type") == "model");
    CHECK(json.at("gaussians") == 5);
  }
  unpack_sog(folder / "a.sog", folder / "sog");
  CHECK(told(folder / "sog").at("gaussians") == 5);
  write_npy(folder / "rays.npy", "False", "(1, 6)", {0, 0, -3, 0, 0, 1});
  REQUIRE(raysplats_program({"generate", folder / "data", "--size", "16", "--train-views", "1",
                             "--test-views", "1", "-q"})
              .code == 0);
  std::optional<double> first;
  for (const char* name : {"a.ply", "a.spz", "a.splat", "a.glb", "a.sog", "sog", "sog/meta.json",
                           "a.compressed.ply"}) {
    CAPTURE(name);
    const auto run = [&](const std::string& command, const std::vector<std::string>& more) {
      std::vector<std::string> words{command, folder / name, "-q"};
      words.insert(words.end(), more.begin(), more.end());
      const Outcome outcome = raysplats_program(words);
      INFO(outcome.err);
      CHECK(outcome.code == 0);
    };
    run("trace", {"--rays", folder / "rays.npy", "-o", folder / "traced.npz", "--overwrite"});
    run("eval", {"--data", folder / "data", "-o", folder / "eval", "--overwrite"});
    run("render", {"--orbit", "1", "--width", "16", "-o", folder / "frames", "--overwrite"});
    const double psnr =
        nlohmann::json::parse(read_file(folder / "eval/metrics.json")).at("psnr").get<double>();
    if (!first) first = psnr;
    CHECK(psnr == doctest::Approx(*first).epsilon(0.02));
  }
  CHECK(convert({folder / "a.glb", "-o", folder / "b.spz", "--spz-version", "4", "--sh-degree", "2",
                 "--rotate", "0,0,90"})
            .code == 0);
  CHECK(told(folder / "b.spz").at("sh_degree") == 2);
}

TEST_CASE("convert takes the output as a word, and a box as one option or by its sides") {
  const TemporaryFolder folder;
  write_file(folder / "balls.ply", ply_file(5));
  const auto bounds = told(folder / "balls.ply").at("bounds");
  const double middle = 0.5 * (bounds[0][0].get<double>() + bounds[1][0].get<double>());
  const auto kept = [&](const std::string& name, const std::vector<std::string>& more) {
    std::vector<std::string> words{"convert", folder / "balls.ply", folder / name};
    words.insert(words.end(), more.begin(), more.end());
    const Outcome outcome = raysplats_program(words);
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    return told(folder / name).at("gaussians").get<int>();
  };
  CHECK(kept("all.spz", {}) == 5);
  const std::string low = std::to_string(middle) + ",-9,-9";
  const int part = kept("box.spz", {"--crop", low + ",9,9,9"});
  CHECK(part > 0);
  CHECK(part < 5);
  CHECK(kept("sides.spz", {"--crop-min", low, "--crop-max", "9,9,9"}) == part);
}

TEST_CASE("convert keeps what the views of a run see") {
  const TemporaryFolder folder;
  const std::filesystem::path run(folder / "run");
  std::filesystem::create_directories(run / "point_cloud/iteration_5");
  write_file(run / "point_cloud/iteration_5/point_cloud.ply", ply_file(5));
  // Balls lie along x, half a unit apart; the camera looks along z and sees the last two.
  write_file(run / "cameras.json",
             "[{\"img_name\":\"a\",\"width\":40,\"height\":40,\"fx\":100,\"fy\":100,\"position\":"
             "[1.85,0,-3],\"rotation\":[[1,0,0],[0,1,0],[0,0,1]]}]");
  const auto kept = [&](const std::string& input, const std::string& name) {
    const Outcome outcome =
        raysplats_program({"convert", input, folder / name, "--max-gaussians", "2"});
    INFO(outcome.err);
    REQUIRE(outcome.code == 0);
    CHECK(
        contains(outcome.err, name == "seen.ply" ? "what is seen in 1 view is kept" : "no views"));
    return raysplats::read_ply(folder / name).means;
  };
  CHECK(kept(run.string(), "seen.ply") == std::vector<float>{1.5f, 0, 0, 2, 0, 0});
  // Not all of many views are looked at.
  const std::string camera = read_file(run / "cameras.json");
  std::string many = camera.substr(0, camera.size() - 1);
  for (int i = 1; i < 70; ++i) many += "," + camera.substr(1, camera.size() - 2);
  write_file(run / "cameras.json", many + "]");
  const Outcome thinned =
      raysplats_program({"convert", run.string(), folder / "many.ply", "--max-gaussians", "2"});
  CHECK(thinned.code == 0);
  CHECK(contains(thinned.err, "what is seen in 64 of 70 views is kept"));
  write_file(folder / "alone.ply", ply_file(5));
  CHECK(kept(folder / "alone.ply", "first.ply") == std::vector<float>{0, 0, 0, 0.5f, 0, 0});
  const Outcome idle =
      raysplats_program({"convert", folder / "alone.ply", folder / "x.ply", "--data", "data"});
  CHECK(idle.code == 2);
  CHECK(one_sentence(idle));
  CHECK(contains(idle.err, "--max-gaussians"));
}

TEST_CASE("convert leaves no half file where a signal comes") {
  const TemporaryFolder folder;
  write_file(folder / "in/balls.ply", ply_file(1500000));
  std::filesystem::create_directory(folder / "out");
  RunningProgram program({"convert", folder / "in/balls.ply", folder / "out/balls.ply"});
  while (program.runs() && entries(folder / "out") == 0) ::usleep(200);
  ::kill(program.process(), SIGTERM);
  const Outcome outcome = program.wait();
  INFO(outcome.err);
  CHECK(outcome.signal == 0);
  CHECK(entries(folder / "out") == (outcome.code == 0 ? 1 : 0));
  CHECK(std::filesystem::exists(folder / "out/balls.ply") == (outcome.code == 0));
}

TEST_CASE("convert says in one sentence what it will not do") {
  const TemporaryFolder folder;
  write_file(folder / "balls.ply", ply_file(5));
  const std::string balls = folder / "balls.ply";
  check_refused({"convert", balls, "-o", folder / "a.obj"}, 2, ".splat");
  check_refused({"convert", balls, "-o", balls, "--overwrite"}, 2, "what is read");
  write_file(folder / "there.spz", "mine");
  check_refused({"convert", balls, "-o", folder / "there.spz"}, 2, "--overwrite");
  CHECK(read_file(folder / "there.spz") == "mine");
  check_refused({"convert", folder / "there.spz", "-o", folder / "b.ply"}, 3, "there.spz");
  check_refused({"convert", balls, "-o", folder / "a.spz", "--crop-min", "90,90,90"}, 2,
                "None of the 5");
  check_refused({"info", folder / "there.spz"}, 3, "there.spz");
  check_refused({"convert", balls, folder / "a.spz", "--crop", "0,0,0,1,1"}, 2, "-1,-1,0,1,1,2");
  check_refused(
      {"convert", balls, folder / "a.spz", "--crop", "0,0,0,1,1,1", "--crop-min", "0,0,0"}, 2,
      "--crop-min");
  check_refused({"convert", balls, folder / "a.spz", "--crop", "1,1,1,0,0,0"}, 2, "swap them");
  check_refused({"convert", balls}, 2, "output");
  check_refused({"convert", balls, folder / "far.ply", "--translate", "1e300,0,0"}, 2,
                "Gaussian 0 would be moved to 1e+300, 0, 0");
  for (const char* scale : {"1e300", "1e-300"})
    check_refused({"convert", balls, folder / "far.ply", "--scale", scale}, 2,
                  "scale is 1e-30 to 1e+30");
  std::string broken = ply_file(1);
  broken.replace(broken.size() - sizeof(float), sizeof(float), "\xff\xff\xff\x7f");
  write_file(folder / "broken.ply", broken);
  check_refused({"convert", folder / "broken.ply", folder / "far.ply", "--drop-nonfinite"}, 3,
                "1 of 1 Gaussians have a number that is not finite");
  CHECK_FALSE(std::filesystem::exists(folder / "far.ply"));
  write_file(folder / "notes.txt", "hello");
  check_refused({"convert", folder / "notes.txt", "-o", folder / "b.ply"}, 3,
                "no model that is known");
}
