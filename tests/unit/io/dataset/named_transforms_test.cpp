// SPDX-License-Identifier: Apache-2.0
// Transforms files that are named themselves, beside others.
#include <doctest/doctest.h>
#include <fmt/format.h>

#include <string>
#include <vector>

#include "raysplats/dataset.hpp"
#include "unit/io/data_sets.hpp"
#include "unit/log_capture.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

/// A transforms file of so many photos 0.png, 1.png, ... in `folder`, and the photos.
void write_scene(const Scratch& scratch,
                 const std::string& file,
                 const std::string& folder,
                 int photos,
                 double focal) {
  std::string frames;
  for (int i = 0; i < photos; ++i) {
    const std::string name = fmt::format("{}/{}.png", folder, i);
    write_image(scratch / name, Image(40, 30, 3, 0.5f));
    frames += fmt::format("{}{{\"file_path\": \"{}\", \"transform_matrix\": {}}}",
                          i > 0 ? ", " : "", name, matrix_json(i));
  }
  write_bytes(
      scratch / file,
      fmt::format("{{\"w\": 40, \"h\": 30, \"fl_x\": {}, \"frames\": [{}]}}", focal, frames));
}

}  // namespace

TEST_CASE("a transforms file that is named is read, whatever lies beside it") {
  const Scratch scratch;
  write_scene(scratch, "transforms.json", "raw", 4, 50);
  write_scene(scratch, "transforms_undistorted.json", "flat", 3, 60);
  CHECK(load_dataset(scratch.path()).views.size() == 4);
  const Dataset named = load_dataset(scratch / "transforms_undistorted.json");
  CHECK(named.kind == DatasetKind::kNerfstudio);
  CHECK(named.root == scratch.path());
  REQUIRE(named.views.size() == 3);
  CHECK(named.views.front().camera.fx == 60);
  CHECK(named.views.front().camera.name == "flat/0.png");
  // A model of COLMAP goes before a file that is not named only.
  const ColmapFixture fixture = small_colmap();
  fixture.write_binary(scratch / "sparse/0");
  write_photos(fixture, scratch / "images", 40, 30);
  CHECK(load_dataset(scratch.path()).kind == DatasetKind::kColmap);
  CHECK(load_dataset(scratch / "transforms.json").views.size() == 4);
  CHECK(load_dataset(scratch / "transforms_undistorted.json").views.size() == 3);
}

TEST_CASE("the transforms files of Blender stand for their folder, one that is alone for itself") {
  const Scratch scratch;
  write_scene(scratch, "transforms_test.json", "test", 2, 50);
  CHECK(load_dataset(scratch / "transforms_test.json").kind == DatasetKind::kNerfstudio);
  write_scene(scratch, "transforms_train.json", "train", 3, 50);
  write_scene(scratch, "transforms.json", "all", 1, 50);
  for (const char* name : {"transforms_test.json", "transforms_train.json"}) {
    const Dataset dataset = load_dataset(scratch / name);
    CHECK(dataset.kind == DatasetKind::kBlender);
    CHECK(dataset.views.size() == 5);
    CHECK(dataset.indices(Split::kTest).size() == 2);
  }
}

TEST_CASE("a test file of Blender's without its photos is left out, which is told") {
  const Scratch scratch;
  write_scene(scratch, "transforms_train.json", "train", 3, 50);
  write_scene(scratch, "transforms_val.json", "val", 1, 50);
  write_scene(scratch, "transforms_test.json", "test", 2, 50);
  CHECK(load_dataset(scratch.path()).views.back().camera.name == "test/1.png");
  // One that is missing is left out as of any file.
  fs::remove(scratch / "test/1.png");
  CHECK(load_dataset(scratch.path()).views.size() == 4);
  fs::remove(scratch / "test/0.png");
  {
    const LogCapture log;
    CHECK(load_dataset(scratch.path()).views.back().camera.name == "val/0.png");
    CHECK(log.contains("none of its 2 photos exist, 'test/0.png' the first"));
  }
  fs::remove(scratch / "val/0.png");
  CHECK(load_dataset(scratch.path()).views.size() == 3);
  CHECK(load_dataset(scratch.path()).indices(Split::kTest) == std::vector<std::size_t>{0});
}

TEST_CASE("a test file of Blender's without frames counts as none, which is told") {
  const Scratch scratch;
  write_scene(scratch, "transforms_train.json", "train", 3, 50);
  write_scene(scratch, "transforms_test.json", "test", 0, 50);
  const LogCapture log;
  CHECK(load_dataset(scratch.path()).indices(Split::kTest) == std::vector<std::size_t>{0});
  CHECK(log.contains("transforms_test.json has no frames: it is not used"));
}

TEST_CASE("photos of a test file of Blender's are not trained on, unless they are most of all") {
  const Scratch scratch;
  write_scene(scratch, "transforms_train.json", "photos", 4, 50);
  write_scene(scratch, "transforms_test.json", "photos", 2, 50);
  {
    const LogCapture log;
    const Dataset dataset = load_dataset(scratch.path());
    REQUIRE(dataset.views.size() == 4);
    CHECK(dataset.views.front().camera.name == "photos/2.png");
    CHECK(dataset.indices(Split::kTest) == std::vector<std::size_t>{2, 3});
    CHECK(log.contains("2 of 4 photos to train on are held out too"));
  }
  write_scene(scratch, "transforms_test.json", "photos", 4, 50);
  const LogCapture log;
  CHECK(load_dataset(scratch.path()).views.size() == 8);
  CHECK(log.contains("4 of 4 held-out photos are trained on as well"));
  CHECK(log.contains("says nothing of unseen views"));
  CHECK(log.lines() == 1);
}
