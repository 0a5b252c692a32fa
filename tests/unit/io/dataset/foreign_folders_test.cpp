// SPDX-License-Identifier: Apache-2.0
// Folders of LLFF and Polycam, and of programs whose data are not read.
#include <doctest/doctest.h>
#include <fmt/format.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "raysplats/dataset.hpp"
#include "raysplats/io.hpp"
#include "unit/io/data_sets.hpp"
#include "unit/log_capture.hpp"
#include "util/rng.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

std::vector<Camera> ring(int count) {
  std::vector<Camera> cameras;
  for (int i = 0; i < count; ++i) {
    const double angle = 0.7 * i;
    cameras.push_back(look_at({3 * std::cos(angle), 3 * std::sin(angle), 0.5 + 0.1 * i},
                              {0, 0.25, 0}, {0, 0, 1}, 80, 60, 70.5));
  }
  return cameras;
}

/// An axis of the camera in the world: 0 right, 1 down, 2 forward.
glm::dvec3 axis(const Camera& camera, int i) {
  return {camera.rotation[0][i], camera.rotation[1][i], camera.rotation[2][i]};
}

void check_pose(const Camera& got, const Camera& expected, double tolerance) {
  CHECK(glm::length(got.center() - expected.center()) < tolerance);
  for (int i = 0; i < 3; ++i) CHECK(glm::length(axis(got, i) - axis(expected, i)) < tolerance);
}

/// LLFF's rows, as its description has them: down, right and back are the columns of the camera's
/// axes, then its place, then height, width and focal length.
void write_llff(const fs::path& path, const std::vector<Camera>& cameras, int columns = 17) {
  std::string data;
  for (const Camera& camera : cameras) {
    const double size[] = {static_cast<double>(camera.height), static_cast<double>(camera.width),
                           camera.fx};
    for (int i = 0; i < 3; ++i) {
      put(data, axis(camera, 1)[i]);
      put(data, axis(camera, 0)[i]);
      put(data, -axis(camera, 2)[i]);
      put(data, camera.center()[i]);
      put(data, size[i]);
    }
    for (int i = 15; i < columns; ++i) put(data, 1.0 + i);
  }
  const std::string header = fmt::format(
      "{{'descr': '<f8', 'fortran_order': False, 'shape': ({}, {}), }}\n", cameras.size(), columns);
  std::string bytes("\x93NUMPY\x01\x00", 8);
  put<std::uint16_t>(bytes, static_cast<std::uint16_t>(header.size()));
  write_bytes(path, bytes + header + data);
}

void write_ring_photos(const fs::path& folder, int count, int width = 80, int height = 60) {
  for (int i = 0; i < count; ++i)
    write_image(folder / fmt::format("IMG_{:02d}.JPG", i), Image(width, height, 3, 0.5f));
}

/// A file of a camera as Polycam writes it: y of the world is up, x and z are the floor.
std::string polycam_camera(const Camera& camera) {
  std::string out = "{\"blur_score\": 120.5, \"manual_keyframe\": false";
  // x, y and z of Polycam's world are y, z and x of ours.
  const int row_of[] = {1, 2, 0};
  for (int row = 0; row < 3; ++row) {
    const int i = row_of[row];
    const double numbers[] = {axis(camera, 0)[i], -axis(camera, 1)[i], -axis(camera, 2)[i],
                              camera.center()[i]};
    for (int column = 0; column < 4; ++column)
      out += fmt::format(", \"t_{}{}\": {:.17g}", row, column, numbers[column]);
  }
  return out + fmt::format(
                   ", \"width\": {}, \"height\": {}, \"fx\": {:.17g}, \"fy\": {:.17g}, \"cx\": 41, "
                   "\"cy\": 29}}",
                   camera.width, camera.height, camera.fx, camera.fx + 1);
}

}  // namespace

TEST_CASE("LLFF: rows of poses_bounds.npy belong to the photos in the order of their names") {
  const Scratch scratch;
  const std::vector<Camera> cameras = ring(9);
  write_llff(scratch / "poses_bounds.npy", cameras);
  write_ring_photos(scratch / "images", 9);
  const Dataset dataset = load_dataset(scratch.path());
  CHECK(dataset.kind == DatasetKind::kLlff);
  REQUIRE(dataset.views.size() == 9);
  CHECK(dataset.points.size() == 0);
  CHECK(dataset.indices(Split::kTest) == std::vector<std::size_t>{0, 8});
  for (std::size_t i = 0; i < 9; ++i) {
    const Camera& camera = dataset.views[i].camera;
    CHECK(camera.name == fmt::format("images/IMG_{:02d}.JPG", i));
    CHECK(camera.model == CameraModel::kPinhole);
    CHECK(camera.fx == 70.5);
    CHECK(camera.fy == 70.5);
    CHECK(camera.cx == 40);
    CHECK(camera.cy == 30);
    check_pose(camera, cameras[i], 1e-6);
  }
}

TEST_CASE("LLFF: reduced copies are taken where they fit, also without the photos they are of") {
  const Scratch scratch;
  write_llff(scratch / "poses_bounds.npy", ring(3));
  write_ring_photos(scratch / "images_4", 3, 20, 15);
  const auto first = [&](double downscale) {
    DatasetOptions options;
    options.downscale = downscale;
    return load_dataset(scratch.path(), options).views.front().camera;
  };
  CHECK(first(1).width == 20);
  CHECK(first(1).fx == doctest::Approx(70.5 / 4));
  CHECK(first(1).name == "images_4/IMG_00.JPG");
  write_ring_photos(scratch / "images", 3);
  CHECK(first(1).width == 80);
  CHECK(first(4).name == "images_4/IMG_00.JPG");
  CHECK(first(4).width == 20);
  CHECK(first(8).width == 10);
  CHECK(first(2).name == "images/IMG_00.JPG");
}

TEST_CASE("LLFF: a model or a transforms file goes before, and what does not fit is refused") {
  const Scratch scratch;
  write_llff(scratch / "poses_bounds.npy", ring(3));
  write_ring_photos(scratch / "images", 2);
  const auto error = [&] { return data_error([&] { load_dataset(scratch.path()); }); };
  CHECK(contains(error(), "3 rows but"));
  CHECK(contains(error(), "2 photos"));
  write_ring_photos(scratch / "images", 3);
  CHECK(load_dataset(scratch.path()).views.size() == 3);
  write_llff(scratch / "poses_bounds.npy", ring(3), 15);
  CHECK(contains(error(), "the shape (3, 15)"));
  std::vector<Camera> bad = ring(3);
  bad[1].rotation[0] *= -1.0;
  write_llff(scratch / "poses_bounds.npy", bad);
  CHECK(contains(error(), "poses_bounds.npy, frame 1"));
  bad = ring(3);
  bad[2].fx = 0;
  write_llff(scratch / "poses_bounds.npy", bad);
  CHECK(contains(error(), "frame 2: 'fl_x' is 0"));
  write_bytes(scratch / "transforms.json",
              "{\"w\": 80, \"h\": 60, \"fl_x\": 70, \"frames\": [{\"file_path\": "
              "\"images/IMG_00.JPG\", \"transform_matrix\": " +
                  matrix_json(1) + "}]}");
  CHECK(load_dataset(scratch.path()).kind == DatasetKind::kNerfstudio);
}

TEST_CASE("Polycam: raw exports are read, the corrected cameras where there are such") {
  const Scratch scratch;
  const std::vector<Camera> cameras = ring(4);
  for (std::size_t i = 0; i < 4; ++i)
    write_bytes(scratch / "keyframes/cameras" / fmt::format("{}.json", 1000 + i),
                polycam_camera(cameras[i]));
  for (int i = 0; i < 4; ++i)
    write_image(scratch / fmt::format("keyframes/images/{}.jpg", 1000 + i), Image(80, 60, 3, 0.5f));
  write_image(scratch / "keyframes/depth/1001.png", Image(40, 30, 1, 0.5f));
  const Dataset dataset = load_dataset(scratch.path());
  CHECK(dataset.kind == DatasetKind::kPolycam);
  REQUIRE(dataset.views.size() == 4);
  for (std::size_t i = 0; i < 4; ++i) {
    const Camera& camera = dataset.views[i].camera;
    check_pose(camera, cameras[i], 1e-12);
    CHECK(camera.name == fmt::format("keyframes/images/{}.jpg", 1000 + i));
    CHECK(camera.fx == 70.5);
    CHECK(camera.fy == 71.5);
    CHECK(camera.cx == 41);
    CHECK(camera.cy == 29);
    CHECK(dataset.views[i].depth_path.empty() == (i != 1));
  }
  CHECK(load_dataset(scratch / "keyframes").views.size() == 4);
  // Processed later: fewer, adjusted cameras.
  for (std::size_t i = 0; i < 2; ++i) {
    write_bytes(scratch / fmt::format("keyframes/corrected_cameras/{}.json", 1002 + i),
                polycam_camera(cameras[i]));
    write_image(scratch / fmt::format("keyframes/corrected_images/{}.jpg", 1002 + i),
                Image(80, 60, 3, 0.5f));
  }
  const Dataset corrected = load_dataset(scratch.path());
  REQUIRE(corrected.views.size() == 2);
  for (std::size_t i = 0; i < 2; ++i) check_pose(corrected.views[i].camera, cameras[i], 1e-12);
  write_bytes(scratch / "keyframes/corrected_cameras/1002.json", "{\"t_20\": 1}");
  const std::string message = data_error([&] { load_dataset(scratch.path()); });
  CHECK(contains(message, "1002.json has no number 't_21'"));
}

TEST_CASE(
    "no flipped byte of LLFF's or Polycam's cameras does anything but load or raise DataError") {
  const Scratch scratch;
  write_ring_photos(scratch / "llff/images", 3);
  write_llff(scratch / "llff/poses_bounds.npy", ring(3));
  write_ring_photos(scratch / "polycam/keyframes/images", 1);
  const fs::path camera = scratch / "polycam/keyframes/cameras/IMG_00.json";
  write_bytes(camera, polycam_camera(ring(1).front()));
  CHECK(load_dataset(scratch / "polycam").views.size() == 1);
  CounterRng rng(12, 13);
  const LogCapture log;
  for (const fs::path& file : {scratch / "llff/poses_bounds.npy", camera}) {
    const std::string whole = read_bytes(file);
    const fs::path root = file == camera ? scratch / "polycam" : scratch / "llff";
    for (int trial = 0; trial < 500; ++trial) {
      std::string bytes = whole;
      if (trial % 5 == 0) bytes.resize(rng.below(bytes.size()));
      for (int i = 0; i < 2 && !bytes.empty(); ++i)
        bytes[rng.below(bytes.size())] = static_cast<char>(rng.below(256));
      write_bytes(file, bytes);
      const std::string message = data_error([&] { load_dataset(root); });
      CHECK(message.find('\n') == std::string::npos);
    }
  }
}

TEST_CASE("folders of programs whose data are not read are named, with the way out") {
  const auto refusal = [](const std::vector<std::string>& files) {
    const Scratch scratch;
    for (const std::string& file : files) write_bytes(scratch / file, "{}");
    const std::string message = data_error([&] { load_dataset(scratch.path()); });
    CHECK(contains(message, "is no data set"));
    CHECK(message.find('\n') == std::string::npos);
    return message;
  };
  CHECK(contains(refusal({"metadata.json", "rgbd/0.jpg", "rgbd/0.depth"}), "ns-process-data"));
  CHECK(contains(refusal({"EXR_RGBD/metadata.json", "EXR_RGBD/rgb/0.png"}), "Record3D"));
  CHECK(!contains(refusal({"metadata.json"}), "Record3D"));
}

TEST_CASE("what macOS leaves beside files (._NAME) is neither a photo nor a camera") {
  const Scratch scratch;
  write_llff(scratch / "llff/poses_bounds.npy", ring(3));
  write_ring_photos(scratch / "llff/images", 3);
  write_bytes(scratch / "llff/images/._IMG_00.JPG", "Mac OS X");
  CHECK(load_dataset(scratch / "llff").views.size() == 3);
  write_ring_photos(scratch / "polycam/keyframes/images", 1);
  write_bytes(scratch / "polycam/keyframes/cameras/IMG_00.json", polycam_camera(ring(1).front()));
  write_bytes(scratch / "polycam/keyframes/cameras/._IMG_00.json", "Mac OS X");
  CHECK(load_dataset(scratch / "polycam").views.size() == 1);
  write_bytes(scratch / "other/._a.jpg", "Mac OS X");
  CHECK(!contains(data_error([&] { load_dataset(scratch / "other"); }), "raysplats prepare"));
}
