// SPDX-License-Identifier: Apache-2.0
#include "train/optimizer/adam.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <vector>

#include "raysplats/error.hpp"
#include "shared/train_layout.h"
#include "unit/fixture.hpp"
#include "util/rng.hpp"

namespace raysplats {
namespace {

Context& context() {
  // Not static: at the end of the program it has to go before what a driver keeps per thread.
  thread_local Context instance(test_device());
  return instance;
}

constexpr std::size_t kGroups = kParameterGroups.size();

std::vector<std::size_t> widths(int degree) {
  std::vector<std::size_t> out;
  for (const ParameterGroup group : kParameterGroups) out.push_back(group_width(group, degree));
  return out;
}

// Host twin of the device state, everything in double.
struct Twin {
  std::vector<std::vector<double>> parameter, first, second;
};

struct Fixture {
  std::size_t count;
  int degree;
  std::vector<std::size_t> width;
  DeviceGaussians gaussians;
  GaussianGradients gradients;
  Twin twin;
  std::vector<std::vector<float>> gradient;  // of the next step, by group
  std::vector<float> screen;
  CounterRng rng{1, 2};

  Fixture(std::size_t n, int sh_degree) : count(n), degree(sh_degree), width(widths(sh_degree)) {
    gaussians.count = n;
    gaussians.sh_degree = sh_degree;
    gaussians.active_sh_degree = sh_degree;
    screen.assign(GaussianGradients::kScreenNumbers * n, 1.0f);
    gradients.screen = Buffer<float>(context(), screen.size(), "screen");
    gradient.resize(kGroups);
    twin.parameter.resize(kGroups);
    twin.first.resize(kGroups);
    twin.second.resize(kGroups);
    for (std::size_t g = 0; g < kGroups; ++g) {
      std::vector<float> start(n * width[g]);
      for (float& value : start) value = static_cast<float>(rng.normal());
      parameters(g) = Buffer<float>(context(), start.size(), "parameters");
      parameters(g).upload(start);
      gradient_buffer(g) = Buffer<float>(context(), start.size(), "gradient");
      twin.parameter[g].assign(start.begin(), start.end());
      twin.first[g].assign(start.size(), 0);
      twin.second[g].assign(start.size(), 0);
      gradient[g].resize(start.size());
    }
  }

  Buffer<float>& parameters(std::size_t g) { return gaussians[kParameterGroups[g]]; }
  Buffer<float>& gradient_buffer(std::size_t g) { return gradients[kParameterGroups[g]]; }
  void random_gradient() {
    for (auto& group : gradient) {
      for (float& value : group)
        value = static_cast<float>(rng.normal() * std::pow(10.0, -4 * rng.uniform()));
    }
  }
  void upload() {
    for (std::size_t g = 0; g < kGroups; ++g) gradient_buffer(g).upload(gradient[g]);
    gradients.screen.upload(screen);
  }
  bool finite(std::size_t i) const {
    for (std::size_t g = 0; g < kGroups; ++g) {
      for (std::size_t k = 0; k < width[g]; ++k) {
        if (!std::isfinite(gradient[g][i * width[g] + k])) return false;
      }
    }
    return true;
  }
  // Algorithm 1 of Kingma and Ba, written as in the paper.
  void twin_step(const AdamOptions& options, const AdamRates& rates, double step) {
    const double group_rates[] = {rates.means, rates.quaternions, rates.scales, rates.opacities};
    for (std::size_t i = 0; i < count; ++i) {
      if (!finite(i) || (options.visible_only && screen[4 * i + 2] == 0)) continue;
      for (std::size_t g = 0; g < kGroups; ++g) {
        for (std::size_t k = 0; k < width[g]; ++k) {
          const std::size_t at = i * width[g] + k;
          const double rate = g < 4 ? group_rates[g] : k < 3 ? rates.sh_dc : rates.sh_rest;
          const double value = gradient[g][at];
          double& m = twin.first[g][at];
          double& v = twin.second[g][at];
          m = options.beta1 * m + (1 - options.beta1) * value;
          v = options.beta2 * v + (1 - options.beta2) * value * value;
          const double m_hat = m / (1 - std::pow(options.beta1, step));
          const double v_hat = v / (1 - std::pow(options.beta2, step));
          twin.parameter[g][at] -= rate * m_hat / (std::sqrt(v_hat) + options.epsilon);
        }
      }
    }
  }
  void check(const Adam& adam, double tolerance) {
    for (std::size_t g = 0; g < kGroups; ++g) {
      CAPTURE(g);
      const std::vector<float> parameter = parameters(g).download();
      const std::vector<float> first = adam.first_moments(kParameterGroups[g]);
      const std::vector<float> second = adam.second_moments(kParameterGroups[g]);
      REQUIRE(parameter.size() == twin.parameter[g].size());
      REQUIRE(first.size() == twin.first[g].size());
      REQUIRE(second.size() == twin.second[g].size());
      double worst = 0;
      for (std::size_t i = 0; i < parameter.size(); ++i) {
        worst = std::max(worst, std::abs(static_cast<double>(parameter[i]) - twin.parameter[g][i]));
        worst = std::max(worst, std::abs(static_cast<double>(first[i]) - twin.first[g][i]));
        worst = std::max(worst, std::abs(static_cast<double>(second[i]) - twin.second[g][i]));
      }
      CHECK(worst < tolerance);
    }
  }
};

const AdamRates kRates{1e-2, 2e-2, 3e-3, 5e-2, 4e-3, 2e-4};

}  // namespace

TEST_CASE("adam: many steps agree with double precision, for every SH degree and vector width") {
  for (const int degree : {0, 1, 2, 3, 4}) {
    for (const int vector : {1, 4, 8, 16}) {
      if (vector != 16 && degree != 2) continue;
      CAPTURE(degree);
      CAPTURE(vector);
      Fixture f(131, degree);
      AdamOptions options;
      options.epsilon = 1e-8;
      Adam adam(context(), options, vector);
      for (int step = 1; step <= 60; ++step) {
        f.random_gradient();
        f.upload();
        adam.step(f.gaussians, f.gradients, kRates);
        f.twin_step(options, kRates, step);
      }
      CHECK(adam.steps() == 60);
      CHECK(adam.skipped() == 0);
      f.check(adam, 2e-5);
    }
  }
}

TEST_CASE(
    "adam: the first step moves every parameter by its learning rate against the sign [small] "
    "[tiny]") {
  Fixture f(5, 1);
  for (auto& group : f.gradient) {
    for (float& value : group) value = -0.125f;
  }
  f.upload();
  Adam adam(context(), AdamOptions{});
  adam.step(f.gaussians, f.gradients, kRates);
  const double rates[] = {1e-2, 2e-2, 3e-3, 5e-2};
  for (std::size_t g = 0; g < kGroups; ++g) {
    const std::vector<float> after = f.parameters(g).download();
    for (std::size_t i = 0; i < after.size(); ++i) {
      const double rate = g < 4 ? rates[g] : i % 12 < 3 ? 4e-3 : 2e-4;
      CHECK(static_cast<double>(after[i]) - f.twin.parameter[g][i] ==
            doctest::Approx(rate).epsilon(1e-2));
    }
  }
}

TEST_CASE("adam: a zero gradient with the smallest epsilon moves nothing") {
  Fixture f(70, 3);
  f.upload();
  Adam adam(context(), AdamOptions{});
  for (int i = 0; i < 3; ++i) adam.step(f.gaussians, f.gradients, kRates);
  for (std::size_t i = 0; i < 3; ++i)
    f.twin_step(AdamOptions{}, kRates, static_cast<double>(i + 1));
  f.check(adam, 1e-30);
}

TEST_CASE("adam: a Gaussian with a non-finite gradient is skipped and counted [small] [tiny]") {
  for (const std::size_t count : {1u, 64u, 150u}) {
    Fixture f(count, 2);
    const AdamOptions options;
    Adam adam(context(), options);
    std::uint32_t expected = 0;
    for (int step = 1; step <= 5; ++step) {
      f.random_gradient();
      const std::size_t bad = static_cast<std::size_t>(step * 29) % count;
      const auto group = static_cast<std::size_t>(step - 1);
      f.gradient[group][bad * f.width[group] + f.width[group] - 1] =
          step % 2 == 0 ? std::numeric_limits<float>::infinity()
                        : std::numeric_limits<float>::quiet_NaN();
      f.upload();
      adam.step(f.gaussians, f.gradients, kRates);
      f.twin_step(options, kRates, step);
      ++expected;
    }
    CHECK(adam.skipped() == expected);
    f.check(adam, 1e-5);
    // Steps of a trial are not those of the run that follows it.
    adam.initialize(count, 2);
    CHECK(adam.skipped() == 0);
  }
}

TEST_CASE("adam: visible_only leaves what no ray met alone [small] [tiny]") {
  Fixture f(200, 1);
  AdamOptions options;
  options.visible_only = true;
  Adam adam(context(), options);
  for (int step = 1; step <= 6; ++step) {
    f.random_gradient();
    for (std::size_t i = 0; i < f.count; ++i) {
      // A block that is hidden as a whole, one that is visible as a whole, and mixed ones.
      f.screen[4 * i + 2] = i < 64 ? 0.0f : i < 128 ? 1.0f : f.rng.uniform() < 0.5 ? 1.0f : 0.0f;
    }
    f.gradient[0][3 * 5] = std::numeric_limits<float>::quiet_NaN();  // hidden: not counted
    f.upload();
    adam.step(f.gaussians, f.gradients, kRates);
    f.twin_step(options, kRates, step);
  }
  CHECK(adam.skipped() == 0);
  f.check(adam, 1e-5);
}

TEST_CASE("adam: remap moves moments with their Gaussians, reset zeroes one group [small] [tiny]") {
  Fixture f(90, 2);
  const AdamOptions options;
  Adam adam(context(), options);
  f.random_gradient();
  f.upload();
  adam.step(f.gaussians, f.gradients, kRates);
  f.twin_step(options, kRates, 1);

  std::vector<std::uint32_t> source;
  for (std::uint32_t i = 0; i < 90; i += 2) source.push_back(i);
  for (std::uint32_t i = 89; i > 20; --i) source.push_back(i % 3 == 0 ? RS_NO_SOURCE : i);
  Buffer<std::uint32_t> sources(context(), source.size(), "sources");
  sources.upload(source);
  adam.remap(sources, source.size());
  adam.reset(ParameterGroup::kOpacities);
  for (std::size_t g = 0; g < kGroups; ++g) {
    const std::vector<float> first = adam.first_moments(kParameterGroups[g]);
    const std::vector<float> second = adam.second_moments(kParameterGroups[g]);
    REQUIRE(first.size() == source.size() * f.width[g]);
    for (std::size_t i = 0; i < source.size(); ++i) {
      for (std::size_t k = 0; k < f.width[g]; ++k) {
        const bool zero =
            source[i] == RS_NO_SOURCE || kParameterGroups[g] == ParameterGroup::kOpacities;
        const std::size_t old = source[i] * f.width[g] + k;
        CHECK(static_cast<double>(first[i * f.width[g] + k]) ==
              doctest::Approx(zero ? 0 : f.twin.first[g][old]).epsilon(1e-6));
        CHECK(static_cast<double>(second[i * f.width[g] + k]) ==
              doctest::Approx(zero ? 0 : f.twin.second[g][old]).epsilon(1e-6));
      }
    }
  }
  CHECK_THROWS_AS(adam.step(f.gaussians, f.gradients, kRates), UsageError);
}

TEST_CASE("adam: a restored optimiser continues to the bit") {
  Fixture a(77, 1);
  Fixture b(77, 1);
  const AdamOptions options;
  Adam whole(context(), options);
  Adam half(context(), options);
  std::vector<std::vector<std::vector<float>>> gradients;
  for (int step = 0; step < 6; ++step) {
    a.random_gradient();
    gradients.push_back(a.gradient);
    a.upload();
    whole.step(a.gaussians, a.gradients, kRates);
  }
  Adam resumed(context(), options);
  for (std::size_t step = 0; step < 6; ++step) {
    b.gradient = gradients[step];
    b.upload();
    if (step < 3) {
      half.step(b.gaussians, b.gradients, kRates);
      continue;
    }
    if (step == 3) {
      resumed.initialize(77, 1);
      for (const ParameterGroup group : kParameterGroups) {
        resumed.restore(group, half.first_moments(group), half.second_moments(group));
      }
      resumed.set_steps(half.steps());
    }
    resumed.step(b.gaussians, b.gradients, kRates);
  }
  for (std::size_t g = 0; g < kGroups; ++g)
    CHECK(a.parameters(g).download() == b.parameters(g).download());
  CHECK_THROWS_AS(
      resumed.restore(ParameterGroup::kMeans, std::vector<float>(3), std::vector<float>(3)),
      UsageError);
}

TEST_CASE(
    "adam: a step takes two launches, and moments lie where they are said to [small] [tiny]") {
  ContextOptions watched;
  watched.profile = watched.keep_launches = true;
  Context own(test_device(), watched);
  Gaussians model;
  model.sh_degree = 2;
  model.resize(75);
  DeviceGaussians gaussians = DeviceGaussians::upload(own, model, ScaleActivation::kExp);
  GaussianGradients gradients;
  gradients.ensure(own, gaussians);
  gradients.screen.clear();
  for (std::size_t g = 0; g < kGroups; ++g) {
    Buffer<float>& buffer = gradients[kParameterGroups[g]];
    buffer.upload(std::vector<float>(buffer.size(), static_cast<float>(g + 1)));
  }
  Adam adam(own, AdamOptions{});
  adam.initialize(75, 2);
  own.finish();
  own.take_launches();
  adam.step(gaussians, gradients, kRates);
  own.finish();
  CHECK(own.take_launches().size() == 2);
  const std::vector<float> moments = adam.first_moments().download();
  for (std::size_t g = 0; g < kGroups; ++g) {
    const ParameterGroup group = kParameterGroups[g];
    const std::vector<float> of_group = adam.first_moments(group);
    CHECK(of_group.size() == 75 * group_width(group, 2));
    CHECK(adam.moment_place(group) % 16 == 0);
    CHECK(std::equal(of_group.begin(), of_group.end(),
                     moments.begin() + static_cast<std::ptrdiff_t>(adam.moment_place(group))));
    CHECK(of_group.back() == doctest::Approx(0.1 * static_cast<double>(g + 1)));
  }
}

TEST_CASE("adam: no Gaussians and bad options") {
  Fixture f(0, 0);
  Adam adam(context(), AdamOptions{});
  f.upload();
  adam.step(f.gaussians, f.gradients, kRates);
  CHECK(adam.steps() == 1);
  AdamOptions options;
  options.beta1 = 1.0;
  CHECK_THROWS_AS(Adam(context(), options), UsageError);
}

}  // namespace raysplats
