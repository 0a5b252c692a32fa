// SPDX-License-Identifier: Apache-2.0
#include "train/optimizer/footprint.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "raysplats/dataset.hpp"
#include "raysplats/device.hpp"
#include "raysplats/io.hpp"
#include "raysplats/trainer.hpp"
#include "run/checkpoint.hpp"
#include "scene/camera/camera_model.hpp"
#include "unit/fixture.hpp"
#include "unit/train/short_training.hpp"
#include "util/rng.hpp"

using namespace raysplats;

namespace {

std::vector<Camera> cameras_of(CameraModel model) {
  std::vector<Camera> out;
  for (int i = 0; i < 5; ++i) {
    const double angle = 1.3 * i;
    out.push_back(look_at({3 * std::cos(angle), 3 * std::sin(angle), 0.5 * i}, {0, 0, 0}, {0, 0, 1},
                          80, 60, 60.0 + 10 * i));
    out.back().model = model;
  }
  return out;
}

// Each pixel is the mean of a block of so many pixels a side.
Image shrunk(const Image& photo, int side) {
  Image out(photo.width / side, photo.height / side, photo.channels);
  for (int y = 0; y < out.height * side; ++y) {
    for (int x = 0; x < out.width * side; ++x) {
      for (int c = 0; c < photo.channels; ++c)
        out.at(x / side, y / side, c) += photo.at(x, y, c) / static_cast<float>(side * side);
    }
  }
  return out;
}

Camera shrunk(Camera camera, int side) {
  camera.width /= side;
  camera.height /= side;
  for (double* value : {&camera.fx, &camera.fy, &camera.cx, &camera.cy}) *value /= side;
  return camera;
}

// Size of a pixel at the point in the camera that resolves it best, in double precision; infinite
// where no camera sees it.
double least_pixel(const std::vector<Camera>& cameras, const glm::dvec3& world) {
  double least = std::numeric_limits<double>::infinity();
  for (const Camera& c : cameras) {
    const glm::dvec3 p = c.rotation * world + c.translation;
    const double focal = std::max(c.fx, c.fy);
    if (c.model == CameraModel::kFisheye) least = std::min(least, glm::length(p) / focal);
    if (c.model == CameraModel::kOrthographic) least = std::min(least, 1.0 / focal);
    if (c.model == CameraModel::kEquirectangular)
      least = std::min(least, glm::length(p) * 2 * std::numbers::pi / c.width);
    if (c.model != CameraModel::kPinhole && c.model != CameraModel::kOpenCv) continue;
    const double x = c.fx * p.x / p.z + c.cx, y = c.fy * p.y / p.z + c.cy;
    const bool seen = p.z > 0 && x >= -0.15 * c.width && x <= 1.15 * c.width &&
                      y >= -0.15 * c.height && y <= 1.15 * c.height;
    if (seen) least = std::min(least, p.z / focal);
  }
  return least;
}

}  // namespace

TEST_CASE("scales are raised to a share of the smallest pixel and left alone above it [small]") {
  Context context(test_device());
  constexpr std::size_t kCount = 200;
  Buffer<std::uint32_t> open(context, 1, "guard");
  open.clear();
  for (const CameraModel model :
       {CameraModel::kPinhole, CameraModel::kOpenCv, CameraModel::kFisheye,
        CameraModel::kEquirectangular, CameraModel::kOrthographic}) {
    for (const ScaleActivation activation : {ScaleActivation::kExp, ScaleActivation::kSigmoid}) {
      CounterRng rng(3, 9);
      Gaussians before;
      before.resize(kCount);
      for (float& v : before.means) v = static_cast<float>(4.0 * rng.uniform() - 2.0);
      for (float& v : before.log_scales) v = static_cast<float>(-9.0 + 8.0 * rng.uniform());
      const std::vector<Camera> cameras = cameras_of(model);
      DeviceGaussians gaussians = DeviceGaussians::upload(context, before, activation);
      Footprint footprint(context, cameras, 0.4);
      footprint.update(gaussians);
      footprint.apply(gaussians, open);
      const Gaussians after = gaussians.download();
      std::size_t raised = 0, unseen = 0;
      for (std::size_t i = 0; i < kCount; ++i) {
        const glm::dvec3 mean(before.means[3 * i], before.means[3 * i + 1],
                              before.means[3 * i + 2]);
        const double least = 0.4 * least_pixel(cameras, mean);
        unseen += std::isinf(least);
        for (std::size_t a = 0; a < 3; ++a) {
          const double size = std::exp(static_cast<double>(before.log_scales[3 * i + a]));
          const double expected = std::isinf(least) ? size : std::max(size, least);
          raised += expected > size;
          CHECK(std::exp(static_cast<double>(after.log_scales[3 * i + a])) ==
                doctest::Approx(expected).epsilon(1e-4));
        }
      }
      CHECK(raised > kCount / 4);
      CHECK(raised < 3 * kCount);
      if (model == CameraModel::kPinhole) CHECK(unseen > 0);
    }
  }
}

TEST_CASE("a marked step, a share of 0 and NaN leave scales as they are [small] [tiny]") {
  Context context(test_device());
  Gaussians before;
  before.resize(2);
  before.log_scales = {-20, -20, -20, std::numeric_limits<float>::quiet_NaN(), -20, -20};
  const std::vector<Camera> cameras = cameras_of(CameraModel::kPinhole);
  Buffer<std::uint32_t> guard(context, 1, "guard");
  guard.upload(std::vector<std::uint32_t>{1});
  DeviceGaussians gaussians = DeviceGaussians::upload(context, before, ScaleActivation::kExp);
  Footprint footprint(context, cameras, 0.4);
  footprint.update(gaussians);
  footprint.apply(gaussians, guard);
  CHECK(gaussians.download().log_scales[0] == -20.0f);
  guard.clear();
  Footprint off(context, cameras, 0.0);
  off.update(gaussians);
  off.apply(gaussians, guard);
  CHECK(gaussians.download().log_scales[0] == -20.0f);
  footprint.apply(gaussians, guard);
  const std::vector<float> raised = gaussians.download().log_scales;
  CHECK(raised[0] > -10.0f);
  CHECK(std::isnan(raised[3]));
  CHECK(raised[4] == raised[0]);
}

TEST_CASE("a run finds the least sizes anew where density control has ended") {
  const TemporaryDirectory folder;
  const std::filesystem::path data = folder.path() / "data", run = folder.path() / "run";
  make_photos(data, 32, 6, 1);
  Context context(test_device());
  TrainOptions options = short_training(130);
  options.densify_every = 40;
  options.densify_until = 0;
  options.checkpoint_every = 40;
  options.keep_checkpoints = 9;
  options.max_gaussians = 400;
  const Dataset dataset = load_dataset(data);
  Trainer(context, dataset, options, run).run(false);
  std::vector<Camera> cameras;
  for (const std::size_t i : dataset.indices(Split::kTrain))
    cameras.push_back(dataset.views[i].camera);
  std::vector<float> before;
  for (const std::int64_t iteration : {40, 80, 120}) {
    const Checkpoint state = read_checkpoint(checkpoint_path(run, iteration));
    Gaussians model;
    model.resize(state.count);
    model.means = state.sections.at("means");
    const DeviceGaussians gaussians =
        DeviceGaussians::upload(context, model, ScaleActivation::kExp);
    Footprint footprint(context, cameras, options.footprint);
    footprint.update(gaussians);
    const std::vector<float> lows = footprint.lows().download();
    CHECK(state.sections.at("footprint") == lows);
    CHECK(lows != before);
    before = lows;
  }
}

TEST_CASE("photos of several sizes learn one model that all of them show") {
  const TemporaryDirectory folder;
  make_photos(folder / "data", 64, 32, 6);
  std::filesystem::create_directories(folder / "photos");
  Context context(test_device());
  Dataset dataset = load_dataset(folder / "data");
  // Three of four photos for training, and half of the others, at an eighth of the size, as from
  // farther away.
  int number = 0, held_out = 0;
  for (View& view : dataset.views) {
    const bool small = view.test ? held_out++ % 2 == 0 : number % 4 != 0;
    const Image photo = load_view_image(view);
    view.image_path = folder / "photos" / (std::to_string(number++) + ".png");
    write_image(view.image_path, small ? shrunk(photo, 8) : photo);
    if (small) view.camera = view.source_camera = shrunk(view.camera, 8);
  }
  const auto psnr = [&](float footprint) {
    TrainOptions options = short_training(500);
    options.trace.view_footprint = footprint;
    options.resolution_schedule.clear();
    std::filesystem::remove_all(folder / "run");
    return Trainer(context, dataset, options, folder / "run").run(false).evaluations.back().psnr;
  };
  const double with = psnr(TrainOptions().trace.view_footprint), without = psnr(0);
  MESSAGE("with the footprint of views ", with, " dB, without ", without);
  CHECK(with > without + 1.5);
}

TEST_CASE("scales keep to fixed limits, with a footprint and without [small] [tiny]") {
  Context context(test_device());
  const std::vector<Camera> cameras = cameras_of(CameraModel::kPinhole);
  Buffer<std::uint32_t> guard(context, 1, "guard");
  for (const ScaleActivation activation : {ScaleActivation::kExp, ScaleActivation::kSigmoid}) {
    Gaussians before;
    before.resize(2);
    const float nan = std::numeric_limits<float>::quiet_NaN();
    before.log_scales = {std::log(1e-3f), std::log(0.5f), std::log(0.05f), nan, -20, -0.1f};
    const Footprint none(context, cameras, 0.0);
    Footprint limited(context, cameras, 0.0, {0.01, 0.2});
    DeviceGaussians gaussians = DeviceGaussians::upload(context, before, activation);
    guard.upload(std::vector<std::uint32_t>{1});
    limited.apply(gaussians, guard);
    CHECK(gaussians.download().log_scales[1] == doctest::Approx(std::log(0.5)).epsilon(1e-5));
    guard.clear();
    limited.apply(gaussians, guard);
    const std::vector<float> after = gaussians.download().log_scales;
    const double expected[] = {0.01, 0.2, 0.05, 0, 0.01, 0.2};
    for (std::size_t k = 0; k < 6; ++k) {
      if (k != 3) CHECK(after[k] == doctest::Approx(std::log(expected[k])).epsilon(1e-4));
    }
    CHECK(std::isnan(after[3]));
    CHECK(none.lows().size() == 0);
  }
}
