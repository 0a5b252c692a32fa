// SPDX-License-Identifier: Apache-2.0
// What is in the folders of pictures after commands that write there.
#include <doctest/doctest.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <string>
#include <vector>

#include "program.hpp"

namespace fs = std::filesystem;

namespace {

void generate(const std::string& folder) {
  REQUIRE(raysplats_program(
              {"generate", folder, "--size", "8", "--train-views", "3", "--test-views", "2", "-q"})
              .code == 0);
}

}  // namespace

TEST_CASE("photos of a data set that is not named are not replaced") {
  const TemporaryFolder folder;
  generate(folder / "data");
  generate(folder / "other");
  write_file(folder / "m.ply", ply_file(2));
  for (const char* place : {"other/train", "other/test", "other"}) {
    CAPTURE(place);
    const std::size_t before = entries(folder / "other");
    for (const Words& words :
         {Words{"render", folder / "m.ply", "--orbit", "2", "--width", "8", "-q"},
          Words{"eval", folder / "m.ply", "--data", folder / "data", "-q"}}) {
      Words into = words;
      into.insert(into.end(), {"-o", folder / place});
      const Outcome outcome = raysplats_program(into);
      CHECK(outcome.code == 2);
      CHECK(one_sentence(outcome));
      CHECK(outcome.err.find("--overwrite") != std::string::npos);
    }
    CHECK(entries(folder / "other") == before);
  }
  const Outcome pages = raysplats_program({"manual", folder / "other"});
  CHECK(pages.code == 2);
  CHECK(one_sentence(pages));
  // Pictures of one's own are made anew, in a data set's folder too.
  for (int round = 0; round < 2; ++round) {
    const Outcome outcome =
        raysplats_program({"render", folder / "m.ply", "--orbit", "2", "--width", "8", "-q", "-o",
                           folder / "other/frames"});
    INFO(outcome.err);
    CHECK(outcome.code == 0);
  }
}

TEST_CASE("an evaluation with few pictures is made again in its folder") {
  const TemporaryFolder folder;
  generate(folder / "data");
  write_file(folder / "m.ply", ply_file(2));
  const std::string out = folder / "out";
  const auto pictures = [&] {
    std::size_t count = 0;
    for (const auto& entry : fs::directory_iterator(out)) {
      if (entry.path().extension() == ".png") ++count;
    }
    return count;
  };
  const auto evaluate = [&](const Words& more) {
    Words words{"eval", folder / "m.ply", "--data", folder / "data", "-o", out, "-q"};
    words.insert(words.end(), more.begin(), more.end());
    const Outcome outcome = raysplats_program(words);
    INFO(outcome.err);
    CHECK(outcome.code == 0);
    return pictures();
  };
  CHECK(evaluate({}) == 2);
  CHECK(evaluate({"--pictures", "1"}) == 1);
  CHECK(evaluate({"--pictures", "1"}) == 1);
  CHECK(evaluate({}) == 2);
  // Those of another split are not what the new metrics.json is about.
  CHECK(evaluate({"--split", "train", "--overwrite"}) == 3);
  CHECK(evaluate({"--pictures", "0", "--overwrite"}) == 0);

  // Pictures of the same names that no evaluation has made stay.
  fs::remove(folder / "out/metrics.json");
  CHECK(evaluate({}) == 2);
  fs::remove(folder / "out/metrics.json");
  CHECK(evaluate({"--pictures", "0", "--overwrite"}) == 2);
}

TEST_CASE("an interrupted rendering names no video, which only whole ones are") {
  const TemporaryFolder folder;
  write_file(folder / "m.ply", ply_file(2));
  RunningProgram program({"render", folder / "m.ply", "--orbit", "20000", "--width", "32", "-o",
                          folder / "out", "--video", folder / "v.apng", "-q"});
  while (program.runs() && !fs::exists(folder / "out/frame_0000.png")) ::usleep(1000);
  ::kill(program.process(), SIGINT);
  const Outcome outcome = program.wait();
  CHECK(outcome.code == 130);
  CHECK(outcome.err.find("what is in " + (folder / "out") +
                         " is whole, and no video was written") != std::string::npos);
  CHECK(!fs::exists(folder / "v.apng"));
}

TEST_CASE("a rendering that nobody reads any more leaves no half video") {
  const TemporaryFolder folder;
  write_file(folder / "m.ply", ply_file(2));
  fs::create_directory(folder / "out");
  // Whoever reads what the program says goes before the first line, or after some of them.
  for (const char* reader : {"true", "head -n 1", "head -n 2", "head -n 3"}) {
    CAPTURE(reader);
    Surroundings around;
    around.launcher = {"/bin/sh", "-c", std::string("\"$@\" 2>&1 | ") + reader, "sh"};
    raysplats_program({"render", folder / "m.ply", "--orbit", "400", "--width", "32", "--video",
                       folder / "out/v.gif"},
                      around);
    fs::remove(folder / "out/v.gif");  // a slow reader gets all of it
    CHECK(entries(folder / "out") == 0);
  }
}

TEST_CASE("a picture that no device holds is called too large") {
  const TemporaryFolder folder;
  write_file(folder / "m.ply", ply_file(2));
  const Outcome outcome = raysplats_program(
      {"render", folder / "m.ply", "--orbit", "1", "--width", "1000000", "-o", folder / "out"});
  CHECK(outcome.code == 5);
  CHECK(outcome.err.find("is too large") != std::string::npos);
  CHECK(outcome.err.find("Gaussians (--max-gaussians)") == std::string::npos);
}
