// SPDX-License-Identifier: Apache-2.0
// Data sets whose size is chosen once their views are known.
#include "io/dataset/sized_dataset.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <limits>
#include <string>

#include "raysplats/dataset.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "unit/io/data_sets.hpp"
#include "unit/log_capture.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

constexpr int kWidth = 64, kHeight = 48, kBar = 6;

// Photos through a lens, between bars, far from the origin.
void write_far_photos(const Scratch& scratch) {
  std::string frames;
  for (int photo = 0; photo < 9; ++photo) {
    Image image(kWidth, kHeight, 3);
    for (int y = kBar; y < kHeight - kBar; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        for (int c = 0; c < 3; ++c) image.at(x, y, c) = 0.3f + 0.005f * static_cast<float>(x + y);
      }
    }
    const std::string name = "photo_" + std::to_string(photo) + ".png";
    write_image(scratch / name, image);
    frames += std::string(photo > 0 ? ", " : "") + "{\"file_path\": \"" + name +
              "\", \"transform_matrix\": " + matrix_json(1e6 + photo) + "}";
  }
  write_bytes(scratch / "transforms.json",
              R"({"camera_model": "OPENCV", "fl_x": 60, "fl_y": 61, "cx": 31.5, "cy": 24.5, )"
              R"("k1": 0.05, "frames": [)" +
                  frames + "]}");
}

void check_equal(const Camera& a, const Camera& b) {
  CHECK(a.name == b.name);
  CHECK(a.width == b.width);
  CHECK(a.height == b.height);
  CHECK(a.fx == b.fx);
  CHECK(a.fy == b.fy);
  CHECK(a.cx == b.cx);
  CHECK(a.cy == b.cy);
  CHECK(a.rotation == b.rotation);
  CHECK(a.translation == b.translation);
  CHECK(a.model == b.model);
  CHECK(a.distortion == b.distortion);
  CHECK((a.lens == nullptr) == (b.lens == nullptr));
}

void check_equal(const Dataset& a, const Dataset& b) {
  CHECK(a.origin == b.origin);
  CHECK(a.points.positions == b.points.positions);
  REQUIRE(a.views.size() == b.views.size());
  for (std::size_t i = 0; i < a.views.size(); ++i) {
    const View &one = a.views[i], &other = b.views[i];
    check_equal(one.camera, other.camera);
    check_equal(one.source_camera, other.source_camera);
    CHECK(one.image_path == other.image_path);
    CHECK(one.points == other.points);
    CHECK(one.test == other.test);
    REQUIRE((one.border == nullptr) == (other.border == nullptr));
    if (one.border) CHECK(*one.border == *other.border);
  }
}

// That a size which is chosen gives the data set of the same size that is asked for, and which one.
Dataset check_chosen(const Scratch& scratch, double factor, bool undistort = true) {
  CAPTURE(factor);
  DatasetOptions options;
  options.undistort = undistort;
  const auto choose = [&](const Dataset& read, double) {
    check_equal(read.views.front().source_camera,
                load_dataset(scratch.path(), options).views.front().source_camera);
    return factor;
  };
  const Dataset chosen = io::load_sized_dataset(scratch.path(), options, choose);
  options.downscale = factor;
  check_equal(chosen, load_dataset(scratch.path(), options));
  // Also where it was read at that size.
  const auto keep = [&](const Dataset&, double) { return factor; };
  check_equal(chosen, io::load_sized_dataset(scratch.path(), options, keep));
  return chosen;
}

}  // namespace

TEST_CASE("a data set whose size is chosen late is the same, and nothing is told twice") {
  const Scratch scratch;
  write_far_photos(scratch);
  for (const double factor : {1.0, 2.0, 2.5}) {
    for (const bool undistort : {true, false}) {
      const Dataset dataset = check_chosen(scratch, factor, undistort);
      CHECK(dataset.origin[0] != 0);
      CHECK(dataset.views.front().border);
      CHECK(dataset.views.front().camera.width == std::lround(kWidth / factor));
    }
  }
  const LogCapture log;
  io::load_sized_dataset(scratch.path(), {}, [](const Dataset& read, double in_files) {
    CHECK(in_files == 1);
    CHECK(read.views.size() == 9);
    CHECK_FALSE(read.views.front().border);  // which takes decoded photos
    return 2.5;
  });
  CHECK(log.lines() == 2);
  CHECK(log.contains("positions count from"));
  CHECK(log.contains("have the same black border"));
}

TEST_CASE("of reduced copies those are taken that the chosen size has") {
  const ColmapFixture fixture = small_colmap();
  const Scratch scratch;
  fixture.write_binary(scratch / "sparse/0");
  write_photos(fixture, scratch / "images", 40, 30);
  check_chosen(scratch, 2);
  write_photos(fixture, scratch / "images_2", 20, 15);
  const auto folder_of = [](const Dataset& dataset) {
    const std::string path = dataset.views.front().image_path.string();
    return contains(path, "/images_2/") ? 2 : contains(path, "/images_4/") ? 4 : 1;
  };
  CHECK(folder_of(check_chosen(scratch, 2)) == 2);
  CHECK(folder_of(check_chosen(scratch, 2.5)) == 1);
  // Without photos at full size.
  const Scratch reduced;
  fixture.write_binary(reduced / "sparse/0");
  write_photos(fixture, reduced / "images_2", 20, 15);
  write_photos(fixture, reduced / "images_4", 10, 8);
  CHECK(folder_of(check_chosen(reduced, 1)) == 2);
  CHECK(folder_of(check_chosen(reduced, 3)) == 2);
  CHECK(folder_of(check_chosen(reduced, 5)) == 4);
}

TEST_CASE("a size that was counted from reduced copies reduces them, where they are all there is") {
  const ColmapFixture fixture = small_colmap();
  const auto width = [&](const Scratch& scratch, double expected_in_files) {
    const auto halve = [&](const Dataset&, double in_files) {
      CHECK(in_files == expected_in_files);
      return 2 * in_files;
    };
    return io::load_sized_dataset(scratch.path(), {}, halve).views.front().camera.width;
  };
  const Scratch scratch;
  fixture.write_binary(scratch / "sparse/0");
  write_photos(fixture, scratch / "images_2", 20, 15);
  CHECK(width(scratch, 2) == 10);
  write_photos(fixture, scratch / "images", 40, 30);
  CHECK(width(scratch, 1) == 20);
  // Copies that are not the model's.
  const Scratch beside;
  fixture.write_binary(beside / "sparse/0");
  write_photos(fixture, beside.path(), 40, 30);
  write_image(beside / "images_2/other.png", Image(20, 15, 3));
  CHECK(width(beside, 1) == 20);
}

TEST_CASE("a chosen size is refused as one that is given [tiny]") {
  const Scratch scratch;
  write_far_photos(scratch);
  for (const double factor : {0.0, 0.5, 1025.0, std::numeric_limits<double>::quiet_NaN()}) {
    CHECK_THROWS_AS(
        io::load_sized_dataset(scratch.path(), {}, [&](const Dataset&, double) { return factor; }),
        UsageError);
  }
}
