// SPDX-License-Identifier: Apache-2.0
// Runs whose length is not given in iterations.
#include <doctest/doctest.h>
#include <fmt/format.h>

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <string>

#include "barred_photos.hpp"
#include "program.hpp"
#include "raysplats/io.hpp"

namespace {

/// The value of a key in the configuration of a run.
std::string value_of(const std::string& run, const std::string& key) {
  const std::string text = read_file(run + "/config.toml");
  const std::string mark = "\n" + key + " = ";
  const std::size_t at = text.find(mark);
  REQUIRE(at != std::string::npos);
  const std::size_t begin = at + mark.size();
  return text.substr(begin, text.find('\n', begin) - begin);
}

}  // namespace

TEST_CASE("the length of a run follows from a time or a quality, and is said beforehand") {
  const TemporaryFolder folder;
  const std::string data = folder / "data", timed = folder / "timed", look = folder / "look";
  succeed({"generate", data, "--size", "48", "--train-views", "5", "--test-views", "2", "-q"});

  const Outcome outcome =
      succeed({"train", data, "-o", timed, "--time", "4s", "--eval-at", "3", "--eval-views", "1"});
  CHECK(contains(outcome.err, "iterations, up to"));
  CHECK(contains(outcome.err, "of training, not counting 2 evaluations of 3 views in all"));
  CHECK(value_of(timed, "iterations") != "10000");
  CHECK(value_of(timed, "max-gaussians") != "0");
  const std::string end = value_of(timed, "end-iteration");  // known once the last steps are timed
  CHECK(end != "0");
  CHECK(contains(outcome.out, end + " iterations in"));
  succeed({"train", data, "-o", folder / "again", "--config", timed + "/config.toml", "-q"});
  const std::string model = "/point_cloud/iteration_" + end + "/point_cloud.ply";
  CHECK(read_file(timed + model) == read_file(folder / "again" + model));

  succeed({"train", data, "-o", look, "--quality", "preview", "--downscale", "4", "-q"});
  CHECK(value_of(look, "iterations") == "300");
  CHECK(value_of(look, "downscale") == "4");
}

TEST_CASE("a quality leaves what a configuration says of length and size") {
  const TemporaryFolder folder;
  const std::string data = folder / "data", look = folder / "look";
  succeed({"generate", data, "--size", "48", "--train-views", "5", "--test-views", "1", "-q"});
  std::ofstream(folder / "my.toml") << "iterations = 12\ndownscale = 3\n";
  succeed(
      {"train", data, "-o", look, "--quality", "preview", "--config", folder / "my.toml", "-q"});
  CHECK(value_of(look, "iterations") == "12");
  CHECK(value_of(look, "downscale") == "3");
}

TEST_CASE("photos that are reduced are looked at once") {
  const TemporaryFolder folder;
  write_barred_photos(folder);
  const Outcome outcome = succeed({"train", folder.path().string(), "-o", folder / "run",
                                   "--quality", "preview", "-n", "2", "--init", "random"});
  CHECK(contains(outcome.err, "Photos are reduced"));
  const std::string line = "have the same black border";
  const std::size_t first = outcome.err.find(line);
  REQUIRE(first != std::string::npos);
  CHECK(outcome.err.find(line, first + 1) == std::string::npos);
}

TEST_CASE("a quality reduces copies that are all there is of the photos") {
  const TemporaryFolder folder;
  constexpr int kWidth = 500, kHeight = 250;
  std::string images;
  for (std::size_t photo = 0; photo < 5; ++photo) {
    raysplats::Image image(kWidth, kHeight, 3);
    for (std::size_t i = 0; i < image.data.size(); ++i)
      image.data[i] = 0.3f + 0.002f * static_cast<float>((i + 7 * photo) % 300);
    raysplats::write_image(folder / fmt::format("images_2/{}.png", photo), image);
    images += fmt::format("{} 1 0 0 0 {} 0 4 1 {}.png\n\n", photo + 1,
                          0.1 * static_cast<double>(photo), photo);
  }
  write_file(folder / "sparse/0/cameras.txt", "1 PINHOLE 1000 500 900 900 500 250\n");
  write_file(folder / "sparse/0/images.txt", images);
  write_file(folder / "sparse/0/points3D.txt", "");
  const std::string run = folder / "run";
  const Outcome outcome = succeed({"train", folder.path().string(), "-o", run, "--quality",
                                   "preview", "-n", "2", "--init", "random"});
  CHECK(contains(outcome.err, "Photos are reduced 6 times each way"));
  CHECK(value_of(run, "downscale") == "6");
  CHECK(contains(read_file(run + "/cameras.json"), "\"width\":167"));
  succeed({"train", folder.path().string(), "-o", run, "--resume", run, "-n", "3"});
  CHECK(contains(read_file(run + "/cameras.json"), "\"width\":167"));
}

TEST_CASE("a command with a quality or a time begins a run, and goes on with it") {
  const TemporaryFolder folder;
  const std::string data = folder / "data", run = folder / "run";
  succeed({"generate", data, "--size", "16", "--train-views", "3", "--test-views", "1", "-q"});
  std::ofstream(folder / "my.toml") << "iterations = 6\n";
  Words words{"train",     data,     "-o",       run,
              "--resume",  "latest", "--config", folder / "my.toml",
              "--quality", "preview"};
  succeed(words);
  CHECK(value_of(run, "iterations") == "6");
  const Outcome again = succeed(words);
  CHECK(contains(again.err, "config.toml names what they chose"));
  CHECK(value_of(run, "iterations") == "6");
  // A run that is named is there already.
  words[5] = run;
  CHECK(raysplats_program(words).code == 2);
}

TEST_CASE("a time or a quality counts anew where the first try left no checkpoint") {
  const TemporaryFolder folder;
  const std::string data = folder / "data", run = folder / "run";
  succeed({"generate", data, "--size", "16", "--train-views", "3", "--test-views", "1", "-q"});
  const auto left_of = [&](const Words& more) {
    std::filesystem::remove_all(run);
    succeed(Words{"train", data, "-o", run, "-n", "5", "--max-gaussians", "40", "--sh-degree", "1",
                  "-q"} +
            more);
    std::filesystem::remove_all(run + "/checkpoints");
    std::filesystem::remove_all(run + "/point_cloud");
  };
  const auto again = [&](const Words& how) {
    const Outcome outcome = succeed(Words{"train", data, "-o", run, "--resume", "latest"} + how);
    CHECK(!contains(outcome.err, "other options than it had"));
    CHECK(value_of(run, "sh-degree") == "1");  // which nobody chooses
  };
  left_of({"--downscale", "2"});
  again({"--quality", "preview"});
  CHECK(value_of(run, "iterations") == "300");
  CHECK(value_of(run, "downscale") == "1");
  left_of({"--end-iteration", "5"});
  again({"--time", "3s"});
  CHECK(value_of(run, "iterations") != "5");
  CHECK(value_of(run, "end-iteration") != "5");
  CHECK(value_of(run, "max-gaussians") != "40");
  // What the command line says is not chosen.
  left_of({});
  again({"--quality", "preview", "-n", "7"});
  CHECK(value_of(run, "iterations") == "7");
}

TEST_CASE("evaluations beyond the end of a run are not left out in silence") {
  const TemporaryFolder folder;
  const std::string data = folder / "data";
  succeed({"generate", data, "--size", "16", "--train-views", "3", "--test-views", "1", "-q"});
  const Outcome outcome =
      succeed({"train", data, "-o", folder / "run", "-n", "3", "--eval-at", "2,5000"});
  CHECK(contains(outcome.err, "eval-at = 5000 is beyond the 3 iterations"));
  CHECK(!contains(outcome.err, "eval-at = 2 "));
}
