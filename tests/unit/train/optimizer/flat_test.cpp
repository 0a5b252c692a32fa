// SPDX-License-Identifier: Apache-2.0
// Flat Gaussians: how they begin, what a step takes off them, and what they cost.
#include "train/start/flat_start.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <glm/geometric.hpp>
#include <vector>

#include "raysplats/context.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/device.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "raysplats/trainer.hpp"
#include "reference/gaussian.hpp"
#include "reference/scenes.hpp"
#include "train/optimizer/footprint.hpp"
#include "train/schedule.hpp"
#include "unit/fixture.hpp"
#include "unit/train/short_training.hpp"
#include "util/rng.hpp"

using namespace raysplats;
namespace fs = std::filesystem;

namespace {

glm::dvec3 third_axis(const Gaussians& model, std::size_t i) {
  const float* q = model.quaternions.data() + 4 * i;
  return reference::rotation_matrix({q[0], q[1], q[2], q[3]})[2];
}

}  // namespace

TEST_CASE("the shortest axis loses what it has above its share of the next one") {
  Context context{test_device()};
  Gaussians model = reference::random_scene(60, 5, 0);
  std::copy_n(std::vector<float>{-2, -2, -2, -1, -3, -3}.begin(), 6, model.log_scales.begin());
  DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  const std::vector<Camera> cameras{look_at({5, 0, 0}, {0, 0, 0}, {0, 0, 1}, 8, 8, 8)};
  Footprint footprint(context, cameras, 0);
  Buffer<std::uint32_t> guard(context, 1, "guard");

  guard.upload(std::vector<std::uint32_t>{1});
  footprint.apply(gaussians, guard, 0.3);
  CHECK(gaussians.scales.download() == model.log_scales);
  guard.upload(std::vector<std::uint32_t>{0});
  footprint.apply(gaussians, guard);
  CHECK(gaussians.scales.download() == model.log_scales);

  footprint.apply(gaussians, guard, 0.3);
  const std::vector<float> thin = gaussians.scales.download();
  std::size_t thinner = 0;
  for (std::size_t i = 0; i < model.size(); ++i) {
    const float* before = model.log_scales.data() + 3 * i;
    std::array<std::size_t, 3> order{2, 1, 0};
    std::stable_sort(order.begin(), order.end(),
                     [&](std::size_t a, std::size_t b) { return before[a] < before[b]; });
    const double most = static_cast<double>(before[order[1]]) + std::log(0.3);
    const double own = static_cast<double>(before[order[0]]);
    thinner += own > most ? 1 : 0;
    CHECK(static_cast<double>(thin[3 * i + order[0]]) ==
          doctest::Approx(std::min(own, most)).epsilon(1e-6));
    CHECK(thin[3 * i + order[1]] == before[order[1]]);
    CHECK(thin[3 * i + order[2]] == before[order[2]]);
  }
  CHECK(thinner > 10);
  CHECK(thinner < model.size());
}

TEST_CASE("flat Gaussians are round to 0.4 of a run and flat from 0.8 on") {
  TrainOptions options;
  options.iterations = 1000;
  CHECK(flat_thickness(options, 999) == 1);
  options.flat = true;
  CHECK(flat_thickness(options, 0) == 1);
  CHECK(flat_thickness(options, 399) == 1);
  CHECK(flat_thickness(options, 599) == doctest::Approx(0.1));
  CHECK(flat_thickness(options, 799) == doctest::Approx(0.01));
  CHECK(flat_thickness(options, 5000) == doctest::Approx(0.01));
}

TEST_CASE("round Gaussians turn their third axis to the nearest camera") {
  Gaussians model = reference::random_scene(40, 6, 0);
  const Gaussians long_ones = model;
  for (std::size_t k = 3; k < model.log_scales.size(); ++k) model.log_scales[k] = -2.0f;
  const std::vector<Camera> cameras{look_at({5, 0, 0}, {0, 0, 0}, {0, 0, 1}, 8, 8, 8),
                                    look_at({0, 0, -5}, {0, 0, 0}, {0, 1, 0}, 8, 8, 8)};
  face_cameras(model, cameras);
  CHECK(std::equal(model.quaternions.begin(), model.quaternions.begin() + 4,
                   long_ones.quaternions.begin()));
  for (std::size_t i = 1; i < model.size(); ++i) {
    const float* m = model.means.data() + 3 * i;
    const glm::dvec3 mean(m[0], m[1], m[2]);
    const glm::dvec3 a = cameras[0].center() - mean, b = cameras[1].center() - mean;
    const glm::dvec3 to = glm::normalize(glm::length(a) < glm::length(b) ? a : b);
    CHECK(glm::dot(third_axis(model, i), to) > 1 - 1e-6);
  }
}

TEST_CASE("flat Gaussians end flat, and cost at most half a decibel before a wall") {
  const TemporaryDirectory folder;
  Context context{test_device()};
  const fs::path data = folder.path() / "data";
  make_photos(data, 48, 20, 4, SyntheticScene::kForward);
  TrainOptions options = short_training(800);
  const auto trained = [&](bool flat, const fs::path& run) {
    options.flat = flat;
    Trainer trainer(context, load_dataset(data), options, run);
    return trainer.run(false).evaluations.back().psnr;
  };
  // Single runs differ by as much.
  double round = 0, flat = 0;
  for (const std::uint64_t seed : {0, 1, 2, 3, 4, 5, 6, 7, 8, 9}) {
    options.seed = seed;
    round += trained(false, folder.path() / ("round" + std::to_string(seed))) / 10;
    flat += trained(true, folder.path() / ("flat" + std::to_string(seed))) / 10;
  }
  MESSAGE("PSNR " << round << " dB, flat " << flat);
  CHECK(flat > round - 0.5);
  const Gaussians model =
      read_model(folder.path() / "flat4/point_cloud/iteration_800/point_cloud.ply");
  for (std::size_t i = 0; i < model.size(); ++i) {
    std::array<float, 3> s{};
    std::copy_n(model.log_scales.begin() + 3 * static_cast<std::ptrdiff_t>(i), 3, s.begin());
    std::sort(s.begin(), s.end());
    CHECK(static_cast<double>(s[0] - s[1]) <= std::log(0.01) + 1e-4);
  }
  options.scale_activation = ScaleActivation::kSigmoid;
  CHECK_THROWS_AS(Trainer(context, load_dataset(data), options, folder.path() / "sigmoid"),
                  UsageError);
}
