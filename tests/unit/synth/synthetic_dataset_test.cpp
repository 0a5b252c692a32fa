// SPDX-License-Identifier: Apache-2.0
#include "synth/synthetic_dataset.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <glm/geometric.hpp>
#include <glm/mat4x4.hpp>
#include <iterator>
#include <nlohmann/json.hpp>
#include <set>
#include <string>
#include <vector>

#include "raysplats/dataset.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "unit/temporary_directory.hpp"

using namespace raysplats;
namespace fs = std::filesystem;

namespace {

std::string bytes_of(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  REQUIRE_MESSAGE(file.good(), path.string());
  return {std::istreambuf_iterator<char>(file), {}};
}

std::set<std::string> files_below(const fs::path& root) {
  std::set<std::string> names;
  for (const auto& entry : fs::recursive_directory_iterator(root)) {
    if (entry.is_regular_file()) names.insert(fs::relative(entry.path(), root).generic_string());
  }
  return names;
}

/// Camera to world, rows as in the file.
glm::dmat4 pose_of(const nlohmann::json& frame) {
  glm::dmat4 matrix(0.0);
  for (int r = 0; r < 4; ++r) {
    for (int c = 0; c < 4; ++c) {
      matrix[c][r] = frame.at("transform_matrix")
                         .at(static_cast<std::size_t>(r))
                         .at(static_cast<std::size_t>(c));
    }
  }
  return matrix;
}

const SyntheticOptions kSmall{.size = 32, .train_views = 4, .test_views = 2, .seed = 0};

}  // namespace

TEST_CASE("equal options give equal bytes and another seed another data set") {
  const TemporaryDirectory first, second, other;
  generate_dataset(first.path(), kSmall);
  generate_dataset(second.path(), kSmall);
  SyntheticOptions seeded = kSmall;
  seeded.seed = 1;
  generate_dataset(other.path(), seeded);
  const std::set<std::string> expected{
      "transforms_train.json", "transforms_test.json", "train/r_0.png", "train/r_1.png",
      "train/r_2.png",         "train/r_3.png",        "test/r_0.png",  "test/r_1.png"};
  CHECK(files_below(first.path()) == expected);
  for (const std::string& name : expected) {
    INFO(name);
    CHECK(bytes_of(first.path() / name) == bytes_of(second.path() / name));
    CHECK(bytes_of(first.path() / name) != bytes_of(other.path() / name));
  }
}

TEST_CASE("the transforms follow the Blender format and the cameras look at the origin") {
  const TemporaryDirectory folder;
  generate_dataset(folder.path(), {.size = 8, .train_views = 24, .test_views = 5, .seed = 3});
  std::vector<glm::dvec3> train, test;
  for (const std::string split : {"train", "test"}) {
    const nlohmann::json file =
        nlohmann::json::parse(bytes_of(folder.path() / ("transforms_" + split + ".json")));
    CHECK(file.at("camera_angle_x").get<double>() == doctest::Approx(0.69));
    REQUIRE(file.at("frames").size() == (split == "train" ? 24u : 5u));
    std::size_t index = 0;
    for (const nlohmann::json& frame : file.at("frames")) {
      const std::string name = frame.at("file_path");
      CHECK(name == "./" + split + "/r_" + std::to_string(index++));
      CHECK(fs::exists(folder.path() / (name + ".png")));
      const glm::dmat4 pose = pose_of(frame);
      const glm::dvec3 right(pose[0]), up(pose[1]), back(pose[2]), eye(pose[3]);
      CHECK(pose[3].w == 1.0);
      CHECK(glm::length(eye) == doctest::Approx(4.0));
      CHECK(eye.z > 0.0);
      // OpenGL: the camera looks along -Z, so the origin lies against the third column.
      CHECK(glm::length(glm::normalize(eye) - back) < 1e-12);
      CHECK(glm::length(glm::cross(right, up) - back) < 1e-12);
      CHECK(std::abs(right.z) < 1e-12);
      CHECK(up.z > 0.0);
      (split == "train" ? train : test).push_back(glm::normalize(eye));
    }
  }
  // Well spread, and no held-out view that a training view has already seen.
  for (std::size_t i = 0; i < train.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) CHECK(glm::length(train[i] - train[j]) > 0.2);
    for (const glm::dvec3& held_out : test) CHECK(glm::length(train[i] - held_out) > 0.05);
  }
}

TEST_CASE("images are RGBA with a transparent surround, an opaque centre and soft edges") {
  const TemporaryDirectory folder;
  generate_dataset(folder.path(), {.size = 64, .train_views = 2, .test_views = 1, .seed = 0});
  for (const char* name : {"train/r_0.png", "train/r_1.png", "test/r_0.png"}) {
    INFO(name);
    const Image image = read_image(folder.path() / name);
    REQUIRE(image.width == 64);
    REQUIRE(image.height == 64);
    REQUIRE(image.channels == 4);
    int clear = 0, opaque = 0, partial = 0;
    std::set<int> levels;
    for (int y = 0; y < 64; ++y) {
      for (int x = 0; x < 64; ++x) {
        const float alpha = image.at(x, y, 3);
        (alpha == 0.0f ? clear : alpha == 1.0f ? opaque : partial) += 1;
        if (alpha == 1.0f) levels.insert(static_cast<int>(std::lround(255.0f * image.at(x, y, 1))));
      }
    }
    CHECK(image.at(0, 0, 3) == 0.0f);
    CHECK(image.at(63, 63, 3) == 0.0f);
    CHECK(clear > 64 * 64 / 4);
    CHECK(opaque > 64 * 64 / 10);
    CHECK(partial > 64);
    CHECK(levels.size() > 60);  // texture and shading
  }
}

TEST_CASE("options outside their range are usage errors and write nothing") {
  const TemporaryDirectory folder;
  const fs::path target = folder.path() / "set";
  CHECK_THROWS_AS(generate_dataset(target, {.size = 7}), UsageError);
  CHECK_THROWS_AS(generate_dataset(target, {.size = 5000}), UsageError);
  CHECK_THROWS_AS(generate_dataset(target, {.train_views = 0}), UsageError);
  CHECK_THROWS_AS(generate_dataset(target, {.test_views = -1}), UsageError);
  CHECK_THROWS_AS(generate_dataset(target, {.train_views = 20000}), UsageError);
  CHECK_FALSE(fs::exists(target));
}

TEST_CASE("a folder that cannot be written is a data error") {
  const TemporaryDirectory folder;
  std::ofstream(folder.path() / "file") << "in the way";
  CHECK_THROWS_AS(generate_dataset(folder.path() / "file", kSmall), DataError);
  CHECK_THROWS_AS(generate_dataset(folder.path() / "file" / "below", kSmall), DataError);
  CHECK_THROWS_AS(generate_dataset("/proc/raysplats", kSmall), DataError);
  // A folder where an image should go: the images fail, and no transforms claim a data set.
  fs::create_directories(folder.path() / "half" / "train" / "r_0.png" / "x");
  CHECK_THROWS_AS(generate_dataset(folder.path() / "half", kSmall, true), DataError);
  CHECK_FALSE(fs::exists(folder.path() / "half" / "transforms_train.json"));
}

TEST_CASE("a data set that was not finished in place of another is none, and is made again") {
  const TemporaryDirectory folder;
  const fs::path set = folder.path() / "set";
  generate_dataset(set, kSmall);
  fs::remove(set / "test" / "r_1.png");
  fs::create_directories(set / "test" / "r_1.png" / "x");
  SyntheticOptions seeded = kSmall;
  seeded.seed = 1;
  CHECK_THROWS_AS(generate_dataset(set, seeded), DataError);
  CHECK_THROWS_AS(load_dataset(set), DataError);
  fs::remove_all(set / "test" / "r_1.png");
  generate_dataset(set, seeded);
  CHECK(load_dataset(set).views.size() == 6);
  CHECK(files_below(set).size() == 8);
}

TEST_CASE("captures with a backdrop are opaque nerfstudio data sets, each of its kind") {
  SyntheticOptions options;
  options.size = 24;
  options.train_views = 5;
  options.test_views = 2;
  const auto pictures = [&](SyntheticScene scene) {
    const TemporaryDirectory scratch;
    options.scene = scene;
    generate_dataset(scratch.path() / "data", options);
    const std::string first = bytes_of(scratch.path() / "data/transforms.json");
    // Again over itself, from the other kind too, and always the same.
    SyntheticOptions still = options;
    still.scene = SyntheticScene::kStillLife;
    generate_dataset(scratch.path() / "data", still);
    CHECK(load_dataset(scratch.path() / "data").kind == DatasetKind::kBlender);
    generate_dataset(scratch.path() / "data", options);
    CHECK(bytes_of(scratch.path() / "data/transforms.json") == first);
    CHECK(files_below(scratch.path() / "data").size() == 8);
    const Dataset dataset = load_dataset(scratch.path() / "data");
    CHECK(dataset.kind == DatasetKind::kNerfstudio);
    CHECK(!dataset.alpha_is_background);
    CHECK(dataset.indices(Split::kTrain).size() == 5);
    CHECK(dataset.indices(Split::kTest).size() == 2);
    std::vector<Image> images;
    for (const View& view : dataset.views) {
      CHECK(read_image(view.image_path).channels == 3);
      images.push_back(load_view_image(view));
      CHECK(*std::max_element(images.back().data.begin(), images.back().data.end()) > 0.2f);
    }
    return images;
  };
  const auto forward = pictures(SyntheticScene::kForward);
  const auto room = pictures(SyntheticScene::kRoom);
  const auto outdoor = pictures(SyntheticScene::kOutdoor);
  CHECK(forward[0].data != room[0].data);
  CHECK(room[0].data != outdoor[0].data);
  // Above the horizon is sky: more blue than red in the top row, whatever the camera's place.
  for (const Image& image : outdoor) CHECK(image.at(12, 0, 2) > image.at(12, 0, 0));
}
