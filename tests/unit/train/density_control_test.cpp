// SPDX-License-Identifier: Apache-2.0
#include "train/density_control.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "base/rng.hpp"
#include "raysplats/device.hpp"
#include "raysplats/error.hpp"

using namespace raysplats;

namespace {

float logit(double x) { return static_cast<float>(std::log(x / (1 - x))); }

// Small scenes: sizes and opacities of each Gaussian are given, the rest is random.
Gaussians model_of(const std::vector<double>& sizes,
                   const std::vector<double>& opacities,
                   int sh_degree = 1) {
  CounterRng rng(5, 2);
  Gaussians model;
  model.sh_degree = sh_degree;
  model.resize(sizes.size());
  for (float& v : model.means) v = static_cast<float>(rng.normal());
  for (float& v : model.quaternions) v = static_cast<float>(rng.normal());
  for (float& v : model.sh) v = static_cast<float>(rng.normal());
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    model.opacities[i] = logit(opacities[i]);
    for (std::size_t a = 0; a < 3; ++a) {
      model.log_scales[3 * i + a] =
          static_cast<float>(std::log(sizes[i] / static_cast<double>(1 + a)));
    }
  }
  return model;
}

TrainOptions rules() {
  TrainOptions options;
  options.densify_grad_threshold = 0.5;
  options.densify_size = 0.1;
  options.prune_opacity = 0.05;
  options.prune_scale = 1.0;
  options.max_gaussians = 100;
  return options;
}

struct Views {
  std::vector<float> screen;  // 3 N
};

void accumulate(Context& context,
                DensityControl& control,
                const DeviceGaussians& gaussians,
                const Views& views) {
  GaussianGradients gradients;
  gradients.screen = Buffer<float>(context, views.screen.size(), "screen");
  gradients.screen.upload(views.screen);
  control.accumulate(gaussians, gradients);
}

}  // namespace

TEST_CASE("statistics sum the chosen signal over the views that see a Gaussian [small] [tiny]") {
  Context context(select_device(""));
  const Gaussians model = model_of({0.01, 0.01, 0.01}, {0.5, 0.5, 0.5});
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  for (const DensifySignal signal : {DensifySignal::kScreen, DensifySignal::kAbsolute}) {
    TrainOptions options = rules();
    options.densify_signal = signal;
    DensityControl control(context, options, 1.0);
    accumulate(context, control, gaussians, {{1, 10, 1, 2, 20, 0, 3, 30, 1}});
    accumulate(context, control, gaussians, {{4, 40, 1, 5, 50, 0, 6, 60, 0}});
    const float f = signal == DensifySignal::kScreen ? 1.0f : 10.0f;
    CHECK(control.statistics().download() == std::vector<float>{5 * f, 2, 0, 0, 3 * f, 1});
  }
}

TEST_CASE("clone, split and prune follow the thresholds [small] [tiny]") {
  Context context(select_device(""));
  for (const ScaleActivation activation : {ScaleActivation::kExp, ScaleActivation::kSigmoid}) {
    // 0 kept, 1 cloned, 2 split, 3 transparent, 4 too large, 5 never seen.
    const Gaussians model =
        model_of({0.05, 0.05, 0.4, 0.05, 1.5, 0.05}, {0.5, 0.5, 0.5, 0.01, 0.5, 0.5});
    TrainOptions options = rules();
    options.prune_scale = activation == ScaleActivation::kExp ? 1.0 : 0.9;
    DeviceGaussians gaussians = DeviceGaussians::upload(context, model, activation);
    DensityControl control(context, options, 1.0);
    accumulate(context, control, gaussians,
               {{0.4f, 0, 1, 0.6f, 0, 1, 0.5f, 0, 1, 9, 0, 1, 9, 0, 1, 9, 0, 0}});
    const DensityPlan plan = control.refine(gaussians, 100);
    CHECK(plan.cloned == 1);
    CHECK(plan.split == 1);
    CHECK(plan.pruned == 2);
    CHECK(plan.refused == 0);
    REQUIRE(plan.source.size() == 6);
    CHECK(gaussians.count == 6);
    std::multiset<std::pair<std::uint32_t, std::uint32_t>> expected{{0, 0}, {1, 0}, {1, 1},
                                                                    {2, 2}, {2, 3}, {5, 0}};
    std::multiset<std::pair<std::uint32_t, std::uint32_t>> found;
    for (std::size_t i = 0; i < 6; ++i) found.insert({plan.source[i], plan.role[i]});
    CHECK(found == expected);
    for (const float sum : control.statistics().download()) CHECK(sum == 0.0f);

    const Gaussians after = gaussians.download();
    for (std::size_t i = 0; i < 6; ++i) {
      const std::size_t s = plan.source[i];
      CHECK(after.opacities[i] == doctest::Approx(model.opacities[s]));
      for (std::size_t k = 0; k < 12; ++k) CHECK(after.sh[12 * i + k] == model.sh[12 * s + k]);
      for (std::size_t k = 0; k < 4; ++k) {
        CHECK(after.quaternions[4 * i + k] == doctest::Approx(model.quaternions[4 * s + k]));
      }
      const bool child = plan.role[i] >= 2;
      double squared = 0;
      for (std::size_t a = 0; a < 3; ++a) {
        const double before = std::exp(static_cast<double>(model.log_scales[3 * s + a]));
        CHECK(std::exp(after.log_scales[3 * i + a]) ==
              doctest::Approx(child ? before / 1.6 : before).epsilon(1e-4));
        squared +=
            std::pow(static_cast<double>(after.means[3 * i + a]) - model.means[3 * s + a], 2);
      }
      // Children leave the mean, but not by more than 6 of the longest standard deviation.
      CHECK((std::sqrt(squared) > 1e-6) == child);
      CHECK(std::sqrt(squared) < 6 * 0.4);
    }
  }
}

TEST_CASE("children are drawn from their parent's distribution, reproducibly") {
  Context context(select_device(""));
  // One Gaussian shape many times over at the origin: the children's whitened offsets must be
  // standard normal.
  constexpr std::size_t kCount = 4000;
  const std::array<double, 4> q{0.3, -0.5, 0.7, 0.2};
  const std::array<double, 3> s{0.2, 0.5, 0.9};
  Gaussians model = model_of(std::vector<double>(kCount, 1.0), std::vector<double>(kCount, 0.5), 0);
  for (std::size_t i = 0; i < kCount; ++i) {
    for (std::size_t a = 0; a < 3; ++a) {
      model.means[3 * i + a] = 0;
      model.log_scales[3 * i + a] = static_cast<float>(std::log(s[a]));
    }
    for (std::size_t a = 0; a < 4; ++a) model.quaternions[4 * i + a] = static_cast<float>(q[a]);
  }
  TrainOptions options = rules();
  options.max_gaussians = 3 * kCount;
  const auto refined = [&](std::int64_t iteration, std::uint64_t seed) {
    options.seed = seed;
    DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
    DensityControl control(context, options, 1.0);
    accumulate(context, control, gaussians, {std::vector<float>(3 * kCount, 1.0f)});
    CHECK(control.refine(gaussians, iteration).split == kCount);
    return gaussians.means.download();
  };
  const std::vector<float> means = refined(100, 1);
  REQUIRE(means.size() == 6 * kCount);
  CHECK(means == refined(100, 1));
  CHECK(means != refined(200, 1));
  CHECK(means != refined(100, 2));

  // Rotation matrix of the normalised quaternion, columns = axes.
  const double n = q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3];
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  const double r[3][3] = {
      {1 - 2 * (y * y + z * z) / n, 2 * (x * y - w * z) / n, 2 * (x * z + w * y) / n},
      {2 * (x * y + w * z) / n, 1 - 2 * (x * x + z * z) / n, 2 * (y * z - w * x) / n},
      {2 * (x * z - w * y) / n, 2 * (y * z + w * x) / n, 1 - 2 * (x * x + y * y) / n}};
  double mean[3] = {}, covariance[3][3] = {};
  for (std::size_t i = 0; i < 2 * kCount; ++i) {
    double white[3];
    for (std::size_t a = 0; a < 3; ++a) {
      white[a] =
          (r[0][a] * means[3 * i] + r[1][a] * means[3 * i + 1] + r[2][a] * means[3 * i + 2]) / s[a];
    }
    for (std::size_t a = 0; a < 3; ++a) {
      mean[a] += white[a] / (2.0 * kCount);
      for (std::size_t b = 0; b < 3; ++b) covariance[a][b] += white[a] * white[b] / (2.0 * kCount);
    }
  }
  for (std::size_t a = 0; a < 3; ++a) {
    CHECK(std::abs(mean[a]) < 0.05);  // standard error 0.011
    for (std::size_t b = 0; b < 3; ++b)
      CHECK(std::abs(covariance[a][b] - (a == b ? 1.0 : 0.0)) < 0.07);
  }
}

TEST_CASE("under the cap the strongest candidates win [small] [tiny]") {
  const std::size_t count = 10;
  const std::vector<float> means(3 * count, 0.0f), scales(3 * count, -5.0f);
  std::vector<float> opacities(count, 0.0f), statistics;
  opacities[9] = -20.0f;
  for (std::size_t i = 0; i < count; ++i) {
    statistics.push_back(static_cast<float>(1 + i % 4));
    statistics.push_back(1.0f);
  }
  DensityRules r;
  r.gradient = 0.5;
  r.split_size = 1;
  r.min_opacity = 0.01;
  r.max_count = 12;
  const DensityPlan plan = plan_density(means, scales, opacities, statistics, r);
  CHECK(plan.pruned == 1);
  CHECK(plan.cloned == 3);
  CHECK(plan.refused == 6);
  CHECK(plan.source.size() == 12);
  std::set<std::uint32_t> cloned;
  for (std::size_t i = 0; i < plan.source.size(); ++i) {
    if (plan.role[i] == 1) cloned.insert(plan.source[i]);
  }
  // Scores 4 at 3 and 7, score 3 at 2 before 6.
  CHECK(cloned == std::set<std::uint32_t>{2, 3, 7});
  r.max_count = 5;  // already above: nothing is added, nothing breaks
  const DensityPlan full = plan_density(means, scales, opacities, statistics, r);
  CHECK(full.cloned + full.split == 0);
  CHECK(full.source.size() == 9);
}

TEST_CASE("Gaussians that are not finite are removed and an empty result is an error") {
  Context context(select_device(""));
  Gaussians model = model_of({0.05, 0.05}, {0.5, 0.5});
  model.means[1] = std::numeric_limits<float>::quiet_NaN();
  DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  DensityControl control(context, rules(), 1.0);
  CHECK(control.refine(gaussians, 1).pruned == 1);
  CHECK(gaussians.count == 1);
  TrainOptions strict = rules();
  strict.prune_opacity = 0.9;
  DensityControl remover(context, strict, 1.0);
  CHECK_THROWS_AS(remover.refine(gaussians, 1), Error);
}

TEST_CASE("opacity reset lowers and never raises [small] [tiny]") {
  Context context(select_device(""));
  DeviceGaussians gaussians = DeviceGaussians::upload(
      context, model_of({0.1, 0.1, 0.1}, {0.9, 0.005, 0.3}), ScaleActivation::kExp);
  TrainOptions options = rules();
  options.opacity_reset_every = 300;
  options.densify_from = 500;
  options.densify_until = 700;
  DensityControl control(context, options, 1.0);
  control.reset_opacities(gaussians);
  const std::vector<float> after = gaussians.opacities.download();
  CHECK(after[0] == doctest::Approx(logit(0.01)));
  CHECK(after[1] == doctest::Approx(logit(0.005)));
  CHECK(after[2] == doctest::Approx(logit(0.01)));
  CHECK(control.resets_at(600));
  CHECK(!control.resets_at(601));
  CHECK(!control.resets_at(900));
  CHECK(control.refines_at(500));
  CHECK(!control.refines_at(400));
  CHECK(!control.refines_at(550));
}
