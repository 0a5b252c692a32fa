// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <glm/matrix.hpp>

#include "io/photo/view_loader.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/io.hpp"
#include "scene/image/pixel_count.hpp"
#include "skip_test.hpp"
#include "unit/io/scratch.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

struct Expected {
  const char* folder;
  DatasetKind kind;
  double downscale;
  std::size_t train, test, points;
  int width, height;
};

/// Share of the points of a cloud that a camera sees inside its picture.
double visible_share(const PointCloud& points, const Camera& camera) {
  std::size_t seen = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const glm::dvec3 world(points.positions[3 * i], points.positions[3 * i + 1],
                           points.positions[3 * i + 2]);
    const glm::dvec3 p = camera.rotation * world + camera.translation;
    if (p.z <= 0) continue;
    const double u = camera.fx * p.x / p.z + camera.cx;
    const double v = camera.fy * p.y / p.z + camera.cy;
    if (u >= 0 && u < camera.width && v >= 0 && v < camera.height) ++seen;
  }
  return points.size() == 0 ? 0 : static_cast<double>(seen) / static_cast<double>(points.size());
}

void check_dataset(const fs::path& root, const Expected& expected) {
  INFO(root.string());
  DatasetOptions options;
  options.downscale = expected.downscale;
  const auto start = std::chrono::steady_clock::now();
  const Dataset dataset = load_dataset(root, options);
  const double open_seconds = seconds_since(start);
  CHECK(dataset.kind == expected.kind);
  CHECK(dataset.indices(Split::kTrain).size() == expected.train);
  CHECK(dataset.indices(Split::kTest).size() == expected.test);
  CHECK(dataset.indices(Split::kAll).size() == expected.train + expected.test);
  CHECK(dataset.points.size() == expected.points);
  for (const View& view : dataset.views) {
    CHECK(view.camera.width == expected.width);
    CHECK(view.camera.height == expected.height);
    CHECK(std::abs(glm::determinant(view.camera.rotation) - 1.0) < 1e-9);
    if (expected.points > 0) CHECK(visible_share(dataset.points, view.camera) > 0.05);
  }
  const auto decode = std::chrono::steady_clock::now();
  io::ViewLoader loader(dataset.views, std::size_t{1} << 30);
  loader.prefetch(dataset.indices(Split::kAll));
  for (std::size_t i = 0; i < dataset.views.size(); ++i) {
    CHECK(loader.get(i)->words.size() == pixel_count(expected.width, expected.height));
  }
  std::printf(
      "%-40s /%g: %zu train, %zu test, %d x %d, %zu points, opened in %.3f s, all views in %.2f "
      "s\n",
      expected.folder, expected.downscale, expected.train, expected.test, expected.width,
      expected.height, dataset.points.size(), open_seconds, seconds_since(decode));
}

}  // namespace

TEST_CASE("real data sets have the views, points and sizes that their descriptions state") {
  const auto data = test_data();
  SKIP_TEST_UNLESS(data, "RAYSPLATS_TEST_DATA is not set: real data are not read");
  for (const Expected& expected : {
           Expected{"colmap/fox_undistorted", DatasetKind::kColmap, 1, 43, 7, 14736, 270, 480},
           Expected{"colmap/can_tiles", DatasetKind::kColmap, 2, 62, 9, 4414, 360, 640},
           Expected{"colmap/snowmiku_plush", DatasetKind::kColmap, 1, 84, 13, 25784, 990, 742},
           Expected{"colmap/snowmiku_plush", DatasetKind::kColmap, 8, 84, 13, 25784, 495, 371},
           Expected{"nerfstudio/fox", DatasetKind::kNerfstudio, 1, 43, 7, 0, 540, 960},
           Expected{"nerf_synthetic/lego", DatasetKind::kBlender, 1, 100, 50, 0, 400, 400},
       }) {
    check_dataset(*data / expected.folder, expected);
  }
}

TEST_CASE("a real distorted photo keeps its pixels and its lens when it is not undistorted") {
  const auto data = test_data();
  SKIP_TEST_UNLESS(data, "RAYSPLATS_TEST_DATA is not set: real data are not read");
  DatasetOptions options;
  options.undistort = false;
  const Dataset dataset = load_dataset(*data / "nerfstudio/fox", options);
  const View& view = dataset.views.front();
  CHECK(view.camera.model == CameraModel::kOpenCv);
  CHECK(view.camera.distortion.k1 == 0.0578421);
  CHECK(view.camera.distortion.k2 == -0.0805099);
  CHECK(view.camera.distortion.p1 == -0.000980296);
  CHECK(view.camera.distortion.p2 == 0.00015575);
  CHECK(view.camera.width == view.source_camera.width);
  const Image photo = read_image(view.image_path);
  const Image kept = load_view_image(view);
  REQUIRE(kept.width == photo.width);
  REQUIRE(kept.height == photo.height);
  const auto channels = static_cast<std::size_t>(photo.channels);
  std::size_t other = 0;
  for (std::size_t i = 0; i < photo.pixels(); ++i) {
    for (std::size_t c = 0; c < 3; ++c)
      other += kept.data[4 * i + c] == photo.data[channels * i + c] ? 0 : 1;
    other += kept.data[4 * i + 3] == 1.0f ? 0 : 1;
  }
  CHECK(other == 0);
  const Dataset undistorted = load_dataset(*data / "nerfstudio/fox");
  CHECK(undistorted.views.front().camera.model == CameraModel::kPinhole);
  CHECK(!undistorted.views.front().camera.distortion.any());
  CHECK(undistorted.views.front().source_camera.model == CameraModel::kOpenCv);
  CHECK(load_view_image(undistorted.views.front()).data != kept.data);
}

TEST_CASE("a real COLMAP model reads the same from text and from binary files") {
  const auto data = test_data();
  SKIP_TEST_UNLESS(data, "RAYSPLATS_TEST_DATA is not set: real data are not read");
  const fs::path source = *data / "colmap/can_tiles";
  const Scratch scratch;
  fs::create_directory_symlink(source / "images", scratch / "images");
  fs::create_directory_symlink(source / "sparse_txt", scratch / "sparse");
  const Dataset binary = load_dataset(source);
  const Dataset text = load_dataset(scratch.path());
  REQUIRE(binary.views.size() == text.views.size());
  for (std::size_t i = 0; i < binary.views.size(); ++i) {
    const View& a = binary.views[i];
    const View& b = text.views[i];
    CHECK(a.camera.name == b.camera.name);
    CHECK(a.camera.fx == doctest::Approx(b.camera.fx).epsilon(1e-12));
    CHECK(a.source_camera.model == b.source_camera.model);
    CHECK(a.source_camera.distortion.k1 ==
          doctest::Approx(b.source_camera.distortion.k1).epsilon(1e-12));
    CHECK(glm::length(a.camera.center() - b.camera.center()) < 1e-9);
    CHECK(a.test == b.test);
  }
  REQUIRE(binary.points.size() == text.points.size());
  double sum_binary = 0;
  double sum_text = 0;
  for (std::size_t i = 0; i < binary.points.positions.size(); ++i) {
    sum_binary += static_cast<double>(binary.points.positions[i]);
    sum_text += static_cast<double>(text.points.positions[i]);
  }
  CHECK(sum_binary == doctest::Approx(sum_text).epsilon(1e-9));
}

TEST_CASE("real trained models load, and survive writing and reading") {
  const auto data = test_data();
  SKIP_TEST_UNLESS(data, "RAYSPLATS_TEST_DATA is not set: real data are not read");
  struct Model {
    const char* folder;
    std::size_t count;
    int degree;
  };
  const Scratch scratch;
  for (const Model& expected : {Model{"rock_lawn", 80000, 3}, Model{"pool_lod4", 212464, 0},
                                Model{"guitar", 90854, 0}, Model{"fox_opensplat", 37173, 3}}) {
    const auto start = std::chrono::steady_clock::now();
    const Gaussians model = read_ply(*data / "trained_3dgs" / expected.folder / "point_cloud.ply");
    const double seconds = seconds_since(start);
    CHECK(model.size() == expected.count);
    CHECK(model.sh_degree == expected.degree);
    write_ply(scratch / "model.ply", model);
    const Gaussians again = read_ply(scratch / "model.ply");
    CHECK(again.means == model.means);
    CHECK(again.log_scales == model.log_scales);
    CHECK(again.opacities == model.opacities);
    CHECK(again.sh == model.sh);
    std::printf("%-40s %zu Gaussians, SH degree %d, read in %.3f s\n", expected.folder,
                model.size(), model.sh_degree, seconds);
  }
  // Packed by PlayCanvas from the PLY beside it, in another order.
  const Gaussians packed = read_model(*data / "trained_3dgs/guitar/guitar.compressed.ply");
  CHECK(packed.size() == 90854);
  const std::vector<Camera> cameras =
      read_cameras(*data / "trained_3dgs/fox_opensplat/transforms.json");
  CHECK(cameras.size() == 50);
  CHECK(cameras.front().width == 269);
  CHECK(cameras.front().height == 479);
  const std::vector<Camera> lego = read_cameras(*data / "nerf_synthetic/lego/transforms_test.json");
  CHECK(lego.size() == 50);
  CHECK(lego.front().width == 400);
  CHECK(lego.front().fx == doctest::Approx(200.0 / std::tan(0.5 * 0.6911112070083618)));
}

TEST_CASE("foreign models of every format hold what their programs say") {
  const auto data = test_data();
  SKIP_TEST_UNLESS(data && fs::exists(*data / "formats"),
                   "RAYSPLATS_TEST_DATA is not set, or has no folder formats");
  const fs::path formats = *data / "formats";
  for (const char* name : {"minimal-v3.spz", "minimal-v4.spz"}) {
    const Gaussians model = read_model(formats / name);
    CHECK(model.means == std::vector<float>{-1, 0, 1, 0, 0, 1, -1, 0, 0, 0, 0, 0});
    CHECK(model.log_scales == std::vector<float>(12, -2.3125f));
    CHECK(model.sh[0] == doctest::Approx(-0.58824).epsilon(1e-4));
    CHECK(model.sh[2] == doctest::Approx(0.01307).epsilon(1e-3));
    CHECK(1.0 / (1.0 + std::exp(-model.opacities[3])) == doctest::Approx(0.90196).epsilon(1e-4));
    CHECK(model.quaternions[0] == doctest::Approx(1.0));
  }
  const Gaussians two = read_model(formats / "minimal-v2.spz");
  CHECK(two.means[2] == -1.0f);
  CHECK(two.sh[0] == doctest::Approx(-1.111).epsilon(1e-3));
  CHECK(two.quaternions[0] == doctest::Approx(0.99998).epsilon(1e-5));
  CHECK(two.quaternions[1] == doctest::Approx(0.0039).epsilon(0.01));
  CHECK(contains(data_error([&] { read_model(formats / "minimal-raw.spz"); }), "gzip"));
  const Gaussians splat = read_model(formats / "minimal.splat");
  CHECK(splat.size() == 4);
  CHECK(splat.log_scales[0] == doctest::Approx(std::log(0.1)));
  const auto check = [](const std::vector<float>& values, const std::vector<double>& expected) {
    for (std::size_t i = 0; i < expected.size(); ++i)
      CHECK(static_cast<double>(values[i]) == doctest::Approx(expected[i]).epsilon(1e-5));
  };
  const Gaussians sog = read_model(formats / "playbot_sog/meta.json");
  REQUIRE(sog.size() == 1873);
  CHECK(sog.sh_degree == 2);
  check(sog.means, {-1.0038020, -0.0209996, -1.0018792});
  check(sog.quaternions, {0.635010, 0.169151, 0.296708, 0.692904});
  check(sog.log_scales, {-7.584230, -4.582156, -4.253626});
  check(sog.sh, {-1.257241, -1.301147, -1.257241, -0.108984, -0.108984, -0.101719});
  CHECK(1.0 / (1.0 + std::exp(-sog.opacities[0])) == doctest::Approx(0.996078).epsilon(1e-5));
  double sums[3] = {};
  for (std::size_t i = 0; i < sog.means.size(); ++i)
    sums[i % 3] += static_cast<double>(sog.means[i]) / 1873.0;
  CHECK(sums[0] == doctest::Approx(3.659e-5).epsilon(1e-3));
  CHECK(sums[1] == doctest::Approx(-0.204976).epsilon(1e-5));
  CHECK(sums[2] == doctest::Approx(-0.0021404).epsilon(1e-4));
  const Gaussians packed = read_model(formats / "pc_test.compressed.ply");
  REQUIRE(packed.size() == 64);
  CHECK(packed.sh_degree == 3);
  check(packed.means, {-1.09285614, -0.81247817, 0.34936113});
  check(packed.log_scales, {-2.446086, -14.426013, -5.735317});
  check(packed.quaternions, {0.9346983, -0.1693462, -0.2702627, 0.1569044});
  check({packed.opacities[0]}, {-1.4615});
  check(packed.sh, {1.22985, 1.36279, 1.39178, 0.046875, 0.046875, 0.015625});
}
