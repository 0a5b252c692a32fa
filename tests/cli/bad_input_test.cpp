// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cstring>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "program.hpp"

namespace {

/// The program refuses with one sentence that names `culprit` and leaves no output folder.
void check_refused_before_output(std::vector<std::string> arguments,
                                 int code,
                                 const std::string& culprit) {
  const TemporaryFolder folder;
  for (const char* word : {"-q", "-o"}) arguments.emplace_back(word);
  arguments.push_back(folder / "output");
  check_refused(arguments, code, culprit);
  CHECK(entries(folder.path()) == 0);
}

/// A COLMAP text model of one camera and two images; `images` of them exist on disk.
void write_colmap(const std::filesystem::path& root) {
  write_file(root / "sparse/0/cameras.txt", "1 PINHOLE 8 6 10 10 4 3\n");
  write_file(root / "sparse/0/images.txt",
             "1 1 0 0 0 0 0 4 1 missing_photo.png\n\n2 1 0 0 0 0.1 0 4 1 other_photo.png\n\n");
  write_file(root / "sparse/0/points3D.txt", "1 0 0 0 255 0 0 0.5 1 0 2 0\n");
  std::filesystem::create_directories(root / "images");
}

}  // namespace

TEST_CASE("a model that cannot be read is exit code 3") {
  const TemporaryFolder folder;
  const std::string path = folder / "model.ply";
  const auto refused = [&](const std::string& content) {
    write_file(path, content);
    check_refused_before_output({"render", path, "--orbit", "2"}, 3, path);
    const Outcome info = raysplats_program({"info", path});
    CHECK(info.code == 3);
    CHECK(one_sentence(info));
  };
  check_refused_before_output({"render", folder / "none.ply", "--orbit", "2"}, 3, "none.ply");
  check_refused_before_output({"eval", folder / "none.ply", "--data", folder / "none"}, 3,
                              "none.ply");

  const std::string good = ply_file(3);
  refused("");
  refused("this is no PLY");
  refused(good.substr(0, good.size() - 5));
  refused(ply_file(3, 4));
  refused(ply_file(3, 4'000'000'000'000'000'000));
  std::string without_opacity = good;
  without_opacity.replace(without_opacity.find("opacity"), 7, "unknown");
  refused(without_opacity);
  std::string with_nan = good;
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(with_nan.data() + with_nan.size() - 56, &nan, sizeof(nan));
  refused(with_nan);
}

TEST_CASE("a path that cannot be followed is exit code 3 with the system's reason") {
  const TemporaryFolder folder;
  std::filesystem::create_symlink("round.ply", folder / "round.ply");
  const std::string model = folder / "model.ply";
  write_file(model, ply_file(3));
  for (const auto& [path, reason] :
       {std::pair(folder / "round.ply", "Too many levels of symbolic links"),
        std::pair(folder / (std::string(300, 'x') + ".ply"), "File name too long")}) {
    for (const std::vector<std::string>& words : std::vector<std::vector<std::string>>{
             {"info", path},
             {"prepare", path, "-o", folder / "data"},
             {"bench", "--model", model, "--cameras", path, "--list"},
             {"render", path, "--orbit", "2", "-o", folder / "pictures"},
             {"view", path},
             {"eval", path, "--data", folder / "data", "-o", folder / "scores"},
             {"train", path, "-o", folder / "run", "-q"},
             {"report", path, "-o", folder / "page.html"}}) {
      CAPTURE(words.front());
      check_refused(words, 3, reason);
    }
  }
}

TEST_CASE("a data set that cannot be read is exit code 3") {
  const TemporaryFolder folder;
  write_file(folder / "model.ply", ply_file(2));
  std::filesystem::create_directories(folder / "empty");
  write_colmap(folder / "colmap");
  for (const char* command : {"train", "eval", "render"}) {
    const auto refused = [&](const std::string& data, const std::string& culprit) {
      std::vector<std::string> arguments{command};
      if (std::string(command) != "train") {
        arguments.push_back(folder / "model.ply");
        arguments.emplace_back("--data");
      }
      arguments.push_back(folder / data);
      check_refused_before_output(arguments, 3, culprit);
    };
    refused("nowhere", "nowhere");
    refused("empty", "empty");
    refused("colmap", "missing_photo.png");
  }
}

TEST_CASE("a broken photo stops training with its name") {
  const TemporaryFolder folder;
  write_colmap(folder / "data");
  write_file(folder / "data/images/missing_photo.png", "");
  write_file(folder / "data/images/other_photo.png", "\x89PNG\r\n\x1a\nbroken");
  check_refused_before_output({"train", folder / "data", "-n", "2", "--test-every", "0"}, 3,
                              "_photo.png");
}

TEST_CASE("cameras that cannot be read are exit code 3") {
  const TemporaryFolder folder;
  write_file(folder / "model.ply", ply_file(2));
  write_file(folder / "cameras.json", "{\"w\": 8, ");
  check_refused_before_output(
      {"render", folder / "model.ply", "--cameras", folder / "cameras.json"}, 3, "cameras.json");
  check_refused_before_output({"render", folder / "model.ply", "--cameras", folder / "none.json"},
                              3, "none.json");
}

TEST_CASE("a wrong configuration is exit code 2 with the nearest key") {
  const TemporaryFolder folder;
  write_file(folder / "typo.toml", "iteratons = 5\n");
  check_refused_before_output({"train", folder / "data", "--config", folder / "typo.toml"}, 2,
                              "'iterations'");
  write_file(folder / "value.toml", "ssim-weight = \"much\"\n");
  check_refused_before_output({"train", folder / "data", "--config", folder / "value.toml"}, 2,
                              "ssim-weight");
  check_refused_before_output({"train", folder / "data", "--config", folder / "none.toml"}, 2,
                              "none.toml");
  check_refused_before_output({"train", folder / "data", "--ssim-weight", "2"}, 2, "ssim-weight");
}

TEST_CASE("a run that cannot begin leaves no folder") {
  const TemporaryFolder folder;
  const std::string data = folder / "data";
  REQUIRE(raysplats_program(
              {"generate", data, "--size", "8", "--train-views", "3", "--test-views", "1", "-q"})
              .code == 0);
  write_file(folder / "notes.txt", "mine");
  write_file(folder / "notes.ply", "mine");
  check_refused_before_output({"train", data, "--init", folder / "none.ply"}, 3, "none.ply");
  check_refused_before_output({"train", data, "--init", folder / "notes.ply"}, 3, "notes.ply");
  check_refused_before_output({"train", data, "--resume", folder / "notes.txt"}, 3,
                              "notes.txt is not a raysplats checkpoint");
  check_refused_before_output({"train", data, "--resume", data}, 3, "holds no valid checkpoint");
  // The sentence depends on whether the build has a viewer.
  check_refused_before_output({"train", data, "--view", "--host", "WRONG"}, 2, "");
}

TEST_CASE("an output that cannot be written is exit code 3") {
  const TemporaryFolder folder;
  write_file(folder / "model.ply", ply_file(2));
  write_file(folder / "file", "in the way");
  for (const std::string& output : {folder / "file", folder / "file/below"}) {
    const Outcome render =
        raysplats_program({"render", folder / "model.ply", "--orbit", "1", "--width", "16",
                           "--height", "16", "-q", "-o", output});
    INFO(render.err);
    CHECK(render.code == 3);
    CHECK(one_sentence(render));
    CHECK(contains(render.err, output));
    const Outcome generate = raysplats_program({"generate", output, "--size", "8", "-q"});
    INFO(generate.err);
    CHECK(generate.code == 3);
    CHECK(one_sentence(generate));
  }
  CHECK(read_file(folder / "file") == "in the way");
}

TEST_CASE("a full disk is exit code 3 and leaves no half-written frame") {
  const TemporaryFolder folder;
  write_file(folder / "model.ply", ply_file(2));
  const std::filesystem::path out = folder / "out";
  Surroundings limited;
  limited.file_size_limit = 2048;
  limited.full_once = [&] { return std::filesystem::exists(out / "frame_0000.exr"); };
  const Outcome outcome =
      raysplats_program({"render", folder / "model.ply", "--orbit", "500", "--width", "128",
                         "--height", "128", "--format", "exr", "-q", "-o", out.string()},
                        limited);
  INFO(outcome.err);
  CHECK(outcome.code == 3);
  CHECK(one_sentence(outcome));
  CHECK(contains(outcome.err, "frame_0"));
  CHECK(contains(outcome.err, ".exr"));
  CHECK(entries(out) > 0);
  CHECK(entries(out) < 500);
  for (const auto& entry : std::filesystem::directory_iterator(out)) {
    CHECK(entry.path().filename().string().starts_with("frame_"));
    CHECK(std::filesystem::file_size(entry.path()) > limited.file_size_limit);
  }
}
