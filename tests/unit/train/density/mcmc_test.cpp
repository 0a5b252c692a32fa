// SPDX-License-Identifier: Apache-2.0
#include "train/density/mcmc.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <vector>

#include "raysplats/device.hpp"
#include "train/density/density_control.hpp"
#include "unit/fixture.hpp"
#include "util/rng.hpp"

using namespace raysplats;

namespace {

constexpr std::size_t kCount = 300;
constexpr double kExtent = 4;

double sigmoid(double x) { return 1 / (1 + std::exp(-x)); }

Gaussians random_model(std::uint64_t seed, std::size_t count = kCount) {
  CounterRng rng(seed, 4);
  Gaussians model;
  model.resize(count);
  for (float& v : model.means) v = static_cast<float>(rng.normal());
  for (float& v : model.quaternions) v = static_cast<float>(rng.normal());
  for (float& v : model.log_scales) v = static_cast<float>(-3 + 2 * rng.uniform());
  for (float& v : model.opacities) v = static_cast<float>(-8 + 10 * rng.uniform());
  return model;
}

Buffer<std::uint32_t> guard_of(std::uint32_t word) {
  Buffer<std::uint32_t> guard(shared_test_context(), 1, "guard");
  guard.upload(std::vector<std::uint32_t>{word});
  return guard;
}

double size_of(float parameter, ScaleActivation activation) {
  return activation == ScaleActivation::kExp ? std::exp(static_cast<double>(parameter))
                                             : sigmoid(static_cast<double>(parameter));
}

}  // namespace

TEST_CASE("pressure adds the gradients of mean opacity and mean size [small]") {
  TrainOptions options;
  options.opacity_reg = 0.3;
  options.scale_reg = 0.7;
  for (const ScaleActivation activation : {ScaleActivation::kExp, ScaleActivation::kSigmoid}) {
    Gaussians model = random_model(1);
    const DeviceGaussians gaussians =
        DeviceGaussians::upload(shared_test_context(), model, activation);
    const std::vector<float> parameters = gaussians.scales.download();
    GaussianGradients gradients;
    gradients.opacities = Buffer<float>(shared_test_context(), kCount, "opacities");
    gradients.scales = Buffer<float>(shared_test_context(), 3 * kCount, "scales");
    const std::vector<float> before(3 * kCount, 0.25f);
    gradients.opacities.upload(std::span(before).first(kCount));
    gradients.scales.upload(before);
    Mcmc mcmc(shared_test_context(), options, kExtent);
    mcmc.add_regularisation(gaussians, gradients, guard_of(1));
    CHECK(gradients.scales.download() == before);
    mcmc.add_regularisation(gaussians, gradients, guard_of(0));
    const std::vector<float> opacity = gradients.opacities.download();
    const std::vector<float> scale = gradients.scales.download();
    for (std::size_t i = 0; i < kCount; ++i) {
      const double a = sigmoid(static_cast<double>(model.opacities[i]));
      CHECK(static_cast<double>(opacity[i]) ==
            doctest::Approx(0.25 + 0.3 / kCount * a * (1 - a)).epsilon(1e-6));
      for (std::size_t k = 0; k < 3; ++k) {
        const double s = size_of(parameters[3 * i + k], activation);
        const double slope = activation == ScaleActivation::kExp ? s : s * (1 - s);
        CHECK(static_cast<double>(scale[3 * i + k]) ==
              doctest::Approx(0.25 + 0.7 / (3 * kCount * kExtent) * slope).epsilon(1e-6));
      }
    }
  }
}

TEST_CASE("noise is normal, shaped by the covariance, for faint Gaussians, and free of scale") {
  constexpr std::size_t kMany = 40000;
  TrainOptions options;
  options.iterations = 101;
  options.position_lr = {1e-3, 1e-5};
  options.mcmc_noise = 50;
  // All alike but the last, which is opaque.
  Gaussians model = random_model(2, 1);
  Gaussians many;
  many.resize(kMany);
  for (std::size_t i = 0; i < kMany; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      many.means[3 * i + k] = 0;
      many.log_scales[3 * i + k] = static_cast<float>(std::log(0.1 * static_cast<double>(k + 1)));
    }
    for (std::size_t k = 0; k < 4; ++k) many.quaternions[4 * i + k] = model.quaternions[k];
    many.opacities[i] = static_cast<float>(std::log(0.01 / 0.99));
  }
  many.opacities.back() = 2.0f;
  const auto moved = [&](double unit, std::int64_t iteration, std::uint32_t word) {
    Gaussians scaled = many;
    for (float& v : scaled.log_scales) v += static_cast<float>(std::log(unit));
    DeviceGaussians gaussians =
        DeviceGaussians::upload(shared_test_context(), scaled, ScaleActivation::kExp);
    Mcmc(shared_test_context(), options, kExtent * unit)
        .add_noise(gaussians, iteration, guard_of(word));
    return gaussians.means.download();
  };
  CHECK(moved(1, 50, 1) == many.means);
  const std::vector<float> means = moved(1, 50, 0);
  CHECK(moved(1, 50, 0) == means);
  CHECK(moved(1, 51, 0) != means);
  for (std::size_t k = 0; k < 3; ++k) CHECK(means[3 * (kMany - 1) + k] == 0);

  // covariance C of the Gaussian; the shift is f C n, whose own covariance is f^2 C C.
  const glm::dquat q(model.quaternions[0], model.quaternions[1], model.quaternions[2],
                     model.quaternions[3]);
  const glm::dmat3 r = glm::mat3_cast(glm::normalize(q));
  glm::dmat3 squares(0.0);
  for (int k = 0; k < 3; ++k) squares[k][k] = 0.01 * (k + 1) * (k + 1);
  const glm::dmat3 covariance = r * squares * glm::transpose(r);
  const double factor = 50 * 0.1 / kExtent / (1 + std::exp(100 * (0.01 - 0.005)));
  const glm::dmat3 expected = factor * factor * covariance * covariance;
  glm::dmat3 found(0.0);
  for (std::size_t i = 0; i + 1 < kMany; ++i) {
    const glm::dvec3 v(means[3 * i], means[3 * i + 1], means[3 * i + 2]);
    found += glm::outerProduct(v, v) / static_cast<double>(kMany - 1);
  }
  const double size = expected[0][0] + expected[1][1] + expected[2][2];
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < 3; ++b) CHECK(std::abs(found[a][b] - expected[a][b]) < 0.02 * size);
  }

  const std::vector<float> larger = moved(10, 50, 0);
  for (std::size_t i = 0; i < 300; ++i)
    CHECK(static_cast<double>(larger[i]) == doctest::Approx(10.0 * means[i]).epsilon(1e-3));
}

TEST_CASE("shares replace opacity and size where they are given [small]") {
  for (const ScaleActivation activation : {ScaleActivation::kExp, ScaleActivation::kSigmoid}) {
    const Gaussians model = random_model(7, 3);
    DeviceGaussians gaussians = DeviceGaussians::upload(shared_test_context(), model, activation);
    const std::vector<float> before = gaussians.scales.download();
    const std::vector<std::array<float, 2>> shares{{0, 0}, {-1.5f, 0.5f}, {0, 0}};
    apply_shares(shared_test_context(), shares, gaussians);
    const std::vector<float> after = gaussians.scales.download();
    const std::vector<float> opacities = gaussians.opacities.download();
    CHECK(opacities == std::vector<float>{model.opacities[0], -1.5f, model.opacities[2]});
    for (std::size_t i = 0; i < 9; ++i) {
      const double factor = i / 3 == 1 ? 0.5 : 1;
      CHECK(size_of(after[i], activation) ==
            doctest::Approx(factor * size_of(before[i], activation)).epsilon(1e-5));
    }
  }
}

TEST_CASE("parts of a Gaussian are drawn from it, what is whole stays where it is [small]") {
  constexpr std::size_t kMany = 4000;
  Gaussians many;
  many.resize(kMany);
  for (std::size_t i = 0; i < kMany; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      many.means[3 * i + k] = static_cast<float>(k);
      many.log_scales[3 * i + k] = static_cast<float>(std::log(0.1 * static_cast<double>(k + 1)));
    }
    many.quaternions[4 * i] = 1;
    many.opacities[i] = i % 2 == 0 ? 0.0f : -9.0f;
  }
  TrainOptions options;
  options.strategy = DensityStrategy::kMcmc;
  options.max_gaussians = kMany;
  options.densify_every = 10;
  DeviceGaussians gaussians =
      DeviceGaussians::upload(shared_test_context(), many, ScaleActivation::kExp);
  DensityControl control(shared_test_context(), options, kExtent, 10);
  const DensityPlan plan = control.refine(gaussians, 10);
  REQUIRE(gaussians.count == kMany);
  const std::vector<float> means = gaussians.means.download();
  std::array<double, 3> square{};
  std::size_t parts = 0;
  for (std::size_t i = 0; i < kMany; ++i) {
    const bool part = plan.role[i] == static_cast<std::uint32_t>(DensityRole::kPart);
    parts += part ? 1 : 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double moved = static_cast<double>(means[3 * i + k]) - static_cast<double>(k);
      if (!part) CHECK(moved == 0);
      square[k] += moved * moved;
    }
  }
  CHECK(parts > kMany / 2);
  for (std::size_t k = 0; k < 3; ++k) {
    CHECK(std::sqrt(square[k] / static_cast<double>(parts)) ==
          doctest::Approx(0.1 * static_cast<double>(k + 1)).epsilon(0.06));
  }
}
