// SPDX-License-Identifier: Apache-2.0
// Flat Gaussians: how they begin, what a step leaves of them, and what they cost.
#include "train/flat_start.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <vector>

#include "raysplats/context.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/device.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "raysplats/trainer.hpp"
#include "reference/gaussian.hpp"
#include "reference/scenes.hpp"
#include "unit/fixture.hpp"
#include "unit/train/short_training.hpp"
#include "util/rng.hpp"

using namespace raysplats;
namespace fs = std::filesystem;

namespace {

// R S^2 R^T of a Gaussian.
glm::dmat3 covariance(const Gaussians& model, std::size_t i) {
  const float* q = model.quaternions.data() + 4 * i;
  const glm::dmat3 turn = reference::rotation_matrix({q[0], q[1], q[2], q[3]});
  glm::dmat3 squares(0.0);
  for (int a = 0; a < 3; ++a) {
    squares[a][a] =
        std::exp(2.0 * static_cast<double>(model.log_scales[3 * i + static_cast<std::size_t>(a)]));
  }
  return turn * squares * glm::transpose(turn);
}

glm::dvec3 third_axis(const Gaussians& model, std::size_t i) {
  const float* q = model.quaternions.data() + 4 * i;
  return reference::rotation_matrix({q[0], q[1], q[2], q[3]})[2];
}

void check_flat(const Gaussians& model) {
  for (std::size_t i = 0; i < model.size(); ++i) {
    const float* s = model.log_scales.data() + 3 * i;
    CHECK(static_cast<double>(s[2] - std::min(s[0], s[1])) ==
          doctest::Approx(std::log(kFlatness)).epsilon(1e-4));
  }
}

}  // namespace

TEST_CASE("a model keeps its other two axes when it is made flat") {
  const Gaussians before = reference::random_scene(60, 5, 0);
  Gaussians model = before;
  flatten(model, {});
  check_flat(model);
  CHECK(model.means == before.means);
  for (std::size_t i = 0; i < model.size(); ++i) {
    // The two covariances differ by what lies along the third axis alone.
    const glm::dvec3 axis = third_axis(model, i);
    const glm::dmat3 a = covariance(before, i), b = covariance(model, i);
    const float* s = before.log_scales.data() + 3 * i;
    const double shortest = std::exp(static_cast<double>(*std::min_element(s, s + 3)));
    const double greatest = std::exp(static_cast<double>(*std::max_element(s, s + 3)));
    CHECK(glm::length(a * axis - shortest * shortest * axis) < 1e-5 * greatest * greatest);
    for (int column = 0; column < 3; ++column) {
      const glm::dvec3 along = glm::cross(axis, glm::dmat3(1.0)[column]);
      CHECK(glm::length(a * along - b * along) < 1e-5 * greatest * greatest);
    }
  }
}

TEST_CASE("round Gaussians turn their flat side to the nearest camera") {
  Gaussians model = reference::random_scene(40, 6, 0);
  for (std::size_t k = 0; k < model.log_scales.size(); ++k) model.log_scales[k] = -2.0f;
  const std::vector<Camera> cameras{look_at({5, 0, 0}, {0, 0, 0}, {0, 0, 1}, 8, 8, 8),
                                    look_at({0, 0, -5}, {0, 0, 0}, {0, 1, 0}, 8, 8, 8)};
  flatten(model, cameras);
  check_flat(model);
  for (std::size_t i = 0; i < model.size(); ++i) {
    const float* m = model.means.data() + 3 * i;
    const glm::dvec3 mean(m[0], m[1], m[2]);
    const glm::dvec3 a = cameras[0].center() - mean, b = cameras[1].center() - mean;
    const glm::dvec3 to = glm::normalize(glm::length(a) < glm::length(b) ? a : b);
    CHECK(glm::dot(third_axis(model, i), to) > 1 - 1e-6);
  }
}

TEST_CASE("flat Gaussians stay flat, and cost at most half a decibel before a wall") {
  const TemporaryDirectory folder;
  Context context{test_device()};
  const fs::path data = folder.path() / "data";
  make_photos(data, 48, 20, 4, SyntheticScene::kForward);
  TrainOptions options = short_training(400);
  const auto trained = [&](bool flat, const fs::path& run) {
    options.flat = flat;
    Trainer trainer(context, load_dataset(data), options, run);
    return trainer.run(false).evaluations.back().psnr;
  };
  const double round = trained(false, folder.path() / "round");
  const double flat = trained(true, folder.path() / "flat");
  MESSAGE("PSNR " << round << " dB, flat " << flat);
  CHECK(flat > round - 0.5);
  check_flat(read_model(folder.path() / "flat/point_cloud/iteration_400/point_cloud.ply"));
  options.scale_activation = ScaleActivation::kSigmoid;
  CHECK_THROWS_AS(Trainer(context, load_dataset(data), options, folder.path() / "sigmoid"),
                  UsageError);
}
