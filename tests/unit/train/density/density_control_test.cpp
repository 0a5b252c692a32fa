// SPDX-License-Identifier: Apache-2.0
#include "train/density/density_control.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <utility>

#include "raysplats/device.hpp"
#include "raysplats/error.hpp"
#include "unit/fixture.hpp"
#include "util/rng.hpp"

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
  options.iterations = 10000;
  options.strategy = DensityStrategy::kAdc;
  options.densify_grad_threshold = 0.5;
  options.densify_size = 0.1;
  options.prune_opacity = 0.05;
  options.prune_scale = 1.0;
  options.max_gaussians = 100;
  return options;
}

// A run of 100 iterations whose budget grows between two of them, every tenth, up to `most`.
TrainOptions growth(int from, int until, int most) {
  TrainOptions options;
  options.iterations = 100;
  options.densify_from = from;
  options.densify_until = until;
  options.densify_every = 10;
  options.max_gaussians = most;
  return options;
}

struct Views {
  std::vector<float> screen;  // kScreenNumbers N

  // Of `count` Gaussians, all numbers of all of them the same.
  static Views alike(std::size_t count, float value = 1.0f) {
    return {std::vector<float>(GaussianGradients::kScreenNumbers * count, value)};
  }
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
  Context context(test_device());
  const Gaussians model = model_of({0.01, 0.01, 0.01}, {0.5, 0.5, 0.5});
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  for (const DensifySignal signal : {DensifySignal::kScreen, DensifySignal::kAbsolute}) {
    TrainOptions options = rules();
    options.densify_signal = signal;
    DensityControl control(context, options, 1.0, 1);
    accumulate(context, control, gaussians, {{1, 10, 1, 0.5f, 2, 20, 0, 9, 3, 30, 1, -2}});
    accumulate(context, control, gaussians, {{4, 40, 1, 0.25f, 5, 50, 0, 9, 6, 60, 0, 9}});
    const float f = signal == DensifySignal::kScreen ? 1.0f : 10.0f;
    CHECK(control.statistics().download() ==
          std::vector<float>{5 * f, 2, 0.75f, 0, 0, 0, 3 * f, 1, -2});
    // The sum over a step's four views.
    accumulate(context, control, gaussians, {{7, 70, 4, 1, 8, 80, 1, 3, 0, 0, 0, 0}});
    CHECK(control.statistics().download() ==
          std::vector<float>{12 * f, 6, 1.75f, 8 * f, 1, 3, 3 * f, 1, -2});
  }
}

TEST_CASE("the signal step is how far the mean has moved over the extent [small] [tiny]") {
  Context context(test_device());
  const Gaussians model = model_of({0.01, 0.01, 0.01}, {0.5, 0.5, 0.5});
  DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  TrainOptions options = rules();
  options.densify_signal = DensifySignal::kStep;
  options.densify_from = 20;
  options.densify_until = 40;
  options.densify_every = 10;
  DensityControl control(context, options, 4.0, 1);
  CHECK(control.measures_step(19));
  CHECK_FALSE(control.measures_step(20));
  CHECK_FALSE(control.measures_step(9));
  Buffer<std::uint32_t> guard(context, 1, "guard");
  guard.clear();
  accumulate(context, control, gaussians, Views::alike(3, 9.0f));
  const std::vector<float> before = gaussians.means.download();
  std::vector<float> after = before;
  after[0] += 0.4f;
  after[4] -= 0.3f;
  after[5] += 0.4f;
  after[6] = std::numeric_limits<float>::quiet_NaN();
  control.begin_step(gaussians);
  gaussians.means.upload(after);
  control.end_step(gaussians, guard);
  const std::vector<float> found = control.statistics().download();
  CHECK(found[0] == doctest::Approx(0.1).epsilon(1e-5));
  CHECK(found[3] == doctest::Approx(0.125).epsilon(1e-5));
  CHECK(found[1] == 1);
  CHECK(found[4] == 1);
  CHECK(found[6] == 0);
  CHECK(found[7] == 0);
  for (std::size_t i = 0; i < 3; ++i) CHECK(found[3 * i + 2] == 0);
  guard.upload(std::vector<std::uint32_t>{1});
  control.end_step(gaussians, guard);
  for (const float value : control.statistics().download()) CHECK(value == 0);
}

TEST_CASE("sizes are the longest axis or the norm of all three [small] [tiny]") {
  // model_of() makes axes of s, s / 2 and s / 3: the norm is 7 / 6 of the longest.
  for (const SizeMeasure measure : {SizeMeasure::kLongest, SizeMeasure::kNorm}) {
    const Gaussians model = model_of({0.09, 0.09, 0.9, 0.009}, {0.5, 0.5, 0.5, 0.5});
    DensityRules rules;
    rules.gradient = 0.5;
    rules.split_size = 0.1;
    rules.max_size = 1.0;
    rules.min_size = 0.01;
    rules.measure = measure;
    rules.max_count = 100;
    const std::vector<float> statistics{1, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0};
    const DensityPlan plan =
        plan_density(model.means, model.log_scales, model.opacities, statistics, rules);
    const bool norm = measure == SizeMeasure::kNorm;
    CHECK(plan.split == (norm ? 1 : 0));
    CHECK(plan.cloned == (norm ? 0 : 1));
    CHECK(plan.large == (norm ? 1 : 0));
    CHECK(plan.small == (norm ? 0 : 1));
  }
}

TEST_CASE("clone, split and prune follow the thresholds [small] [tiny]") {
  Context context(test_device());
  for (const ScaleActivation activation : {ScaleActivation::kExp, ScaleActivation::kSigmoid}) {
    // 0 kept, 1 cloned, 2 split, 3 transparent, 4 too large, 5 never seen.
    const Gaussians model =
        model_of({0.05, 0.05, 0.4, 0.05, 1.5, 0.05}, {0.5, 0.5, 0.5, 0.01, 0.5, 0.5});
    TrainOptions options = rules();
    options.prune_scale = activation == ScaleActivation::kExp ? 1.0 : 0.9;
    DeviceGaussians gaussians = DeviceGaussians::upload(context, model, activation);
    DensityControl control(context, options, 1.0, 1);
    accumulate(context, control, gaussians,
               {{0.4f, 0, 1, 0, 0.6f, 0, 1, 0, 0.5f, 0, 1, 0, 9, 0, 1, 0, 9, 0, 1, 0, 9, 0, 0, 0}});
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
  Context context(test_device());
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
    DensityControl control(context, options, 1.0, 1);
    accumulate(context, control, gaussians, Views::alike(kCount));
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
    statistics.insert(statistics.end(), {static_cast<float>(1 + i % 4), 1.0f, 0.0f});
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
  Context context(test_device());
  Gaussians model = model_of({0.05, 0.05}, {0.5, 0.5});
  model.means[1] = std::numeric_limits<float>::quiet_NaN();
  DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  DensityControl control(context, rules(), 1.0, 1);
  CHECK(control.refine(gaussians, 1).pruned == 1);
  CHECK(gaussians.count == 1);
  TrainOptions strict = rules();
  strict.prune_opacity = 0.9;
  const auto advice = [&](const TrainOptions& options) {
    DensityControl remover(context, options, 1.0, 1);
    try {
      remover.refine(gaussians, 1);
    } catch (const Error& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  CHECK(advice(strict).find("lower --prune-opacity") != std::string::npos);
  TrainOptions narrow = rules();
  narrow.prune_scale = 1e-6;
  CHECK(advice(narrow).find("raise --prune-scale") != std::string::npos);
  TrainOptions wide = rules();
  wide.prune_scale = 0;
  wide.prune_scale_min = 1e6;
  CHECK(advice(wide).find("lower --prune-scale-min") != std::string::npos);
}

TEST_CASE("a refinement that takes off opacities alone makes another model [small] [tiny]") {
  Context context(test_device());
  DeviceGaussians gaussians = DeviceGaussians::upload(
      context, model_of({0.1, 0.1, 0.1}, {0.9, 0.5, 0.3}), ScaleActivation::kExp);
  TrainOptions options = growth(10, 50, 3);
  options.opacity_decay = 0.01;
  DensityControl control(context, options, 1.0, 1);
  const auto revision = gaussians.revision;
  CHECK(!control.refine(gaussians, 10).changes());
  CHECK(gaussians.opacities.download()[1] == doctest::Approx(logit(0.49)));
  CHECK(gaussians.revision != revision);
}

TEST_CASE("opacity reset lowers and never raises [small] [tiny]") {
  Context context(test_device());
  DeviceGaussians gaussians = DeviceGaussians::upload(
      context, model_of({0.1, 0.1, 0.1}, {0.9, 0.005, 0.3}), ScaleActivation::kExp);
  TrainOptions options = rules();
  options.opacity_reset_every = 300;
  options.densify_from = 500;
  options.densify_until = 700;
  DensityControl control(context, options, 1.0, 1);
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

TEST_CASE("a budget removes what is not or hardly seen and halves the highest means up to it") {
  // 0 transparent, 1 unseen, 2 to 5 with mean signals 3, 5, 5, 1, 6 not finite.
  std::vector<float> means(21, 0.0f), scales(21, -1.0f), opacities(7, 1.0f);
  opacities[0] = logit(0.001);
  scales[18] = std::numeric_limits<float>::quiet_NaN();
  for (std::size_t i = 0; i < 7; ++i) means[3 * i] = static_cast<float>(i);
  // What rays blend of 3 is too little, of 2 just enough.
  const std::vector<float> statistics{9,  1,  1, 0, 0, 0, 6, 2,  0, 5, 1,
                                      -1, 10, 2, 1, 1, 1, 1, 99, 1, 1};
  const auto halved = [&](const BudgetRules& rules) {
    const DensityPlan plan = plan_budget(means, scales, opacities, statistics, rules);
    std::multiset<std::uint32_t> out;
    for (std::size_t i = 0; i < plan.source.size(); ++i) {
      if (plan.role[i] == static_cast<std::uint32_t>(DensityRole::kFirstHalf))
        out.insert(plan.source[i]);
      CHECK(plan.source[i] != 0);
      CHECK(plan.source[i] != 6);
    }
    CHECK(plan.source.size() == plan.role.size());
    CHECK(plan.split == out.size());
    return std::pair(plan.source.size(), out);
  };
  using Set = std::multiset<std::uint32_t>;
  CHECK(halved({5, 0.005, false, false, {}}) == std::pair(std::size_t{5}, Set{}));
  CHECK(halved({6, 0.005, false, false, {}}) == std::pair(std::size_t{6}, Set{3}));
  CHECK(halved({6, 0.005, true, false, {}}) == std::pair(std::size_t{6}, Set{3, 4}));
  CHECK(halved({7, 0.005, true, false, {}}) == std::pair(std::size_t{7}, Set{2, 3, 4}));
  CHECK(halved({100, 0.005, true, false, {}}) == std::pair(std::size_t{8}, Set{2, 3, 4, 5}));
  CHECK(halved({1, 0.005, true, false, {}}).first == 4);
  CHECK(halved({1, 0.005, true, true, {}}).first == 3);
  CHECK(halved({5, 0.005, true, true, {}}) == std::pair(std::size_t{5}, Set{2, 4}));
}

TEST_CASE("passes come after whole passes over the photos, near the usual period [small]") {
  Context context(test_device());
  const auto period = [&](std::int64_t iterations, std::size_t views, const char* init = "auto") {
    TrainOptions options;
    options.init = init;
    options.iterations = iterations;
    options.densify_from = 1;
    const DensityControl control(context, options, 1.0, views);
    std::int64_t first = 1;
    while (!control.refines_at(first)) ++first;
    return first;
  };
  // 50 at least: one pass or several.
  CHECK(period(1000, 60) == 60);
  CHECK(period(1000, 20) == 60);
  CHECK(period(1000, 12) == 60);
  CHECK(period(1000, 43) == 86);
  // Or just below, where one more would be far above, in short runs and from random starts.
  CHECK(period(500, 60) == 60);
  CHECK(period(500, 30) == 60);
  CHECK(period(500, 43) == 43);
  CHECK(period(500, 36) == 36);
  CHECK(period(1000, 43, "random") == 43);
  // A tenth of short runs and a hundredth of long ones.
  CHECK(period(300, 43) == 43);
  CHECK(period(10000, 43) == 129);
  CHECK(period(10000, 80) == 160);
}

TEST_CASE("the budget's count follows its curve to the limit and stays there [small]") {
  Context context(test_device());
  constexpr std::size_t kCount = 100;
  TrainOptions options;
  options.iterations = 1000;
  options.densify_from = 100;
  options.densify_until = 600;
  options.densify_every = 100;
  options.replace_until = 800;
  options.max_gaussians = 300;
  DeviceGaussians gaussians = DeviceGaussians::upload(
      context, model_of(std::vector<double>(kCount, 0.1), std::vector<double>(kCount, 0.9)),
      ScaleActivation::kExp);
  DensityControl control(context, options, 1.0, 7);
  for (std::int64_t iteration = 100; iteration <= 800; iteration += 100) {
    CHECK(control.refines_at(iteration));
    accumulate(context, control, gaussians, Views::alike(gaussians.count));
    control.refine(gaussians, iteration);
    const double left = std::clamp((600.0 - static_cast<double>(iteration)) / 500.0, 0.0, 1.0);
    const double curve = 300.0 - 200.0 * left * left;
    CHECK(std::abs(static_cast<double>(gaussians.count) - curve) <= 3.0);
  }
  CHECK(!control.refines_at(900));
  CHECK(!control.accumulates_at(800));
}

TEST_CASE("what no ray met goes once every photo was looked at [small] [tiny]") {
  Context context(test_device());
  TrainOptions options = growth(0, 60, 2);
  options.views_per_step = 2;
  // Three photos, two in a step: two steps show four, which may leave one out.
  for (const auto& [period, unseen] : {std::pair{2, 0u}, {3, 1u}}) {
    CAPTURE(period);
    options.densify_every = period;
    DeviceGaussians gaussians =
        DeviceGaussians::upload(context, model_of({0.1, 0.1}, {0.9, 0.9}), ScaleActivation::kExp);
    DensityControl control(context, options, 1.0, 3);
    accumulate(context, control, gaussians, {{1, 10, 1, 1, 0, 0, 0, 0}});
    CHECK(control.refine(gaussians, 90).unseen == unseen);
  }
}

TEST_CASE("what rays blend little of goes behind a second whole pass over the photos [small]") {
  Context context(test_device());
  const TrainOptions options = growth(10, 60, 3);
  const Views views{{1, 10, 1, 0.5f, 1, 10, 1, -0.5f, 1, 10, 1, 0.0f}};
  for (const std::size_t photos : {10, 5, 3}) {
    for (const std::int64_t iteration : {10, 20}) {
      CAPTURE(photos);
      CAPTURE(iteration);
      DeviceGaussians gaussians = DeviceGaussians::upload(
          context, model_of({0.1, 0.1, 0.1}, {0.9, 0.9, 0.9}), ScaleActivation::kExp);
      DensityControl control(context, options, 1.0, photos);
      accumulate(context, control, gaussians, views);
      const DensityPlan plan = control.refine(gaussians, iteration);
      CHECK(plan.hardly_seen == (iteration == 20 ? 1 : 0));
      CHECK(plan.pruned == plan.hardly_seen);
    }
  }
  // Ten steps that do not show every photo.
  DeviceGaussians gaussians = DeviceGaussians::upload(
      context, model_of({0.1, 0.1, 0.1}, {0.9, 0.9, 0.9}), ScaleActivation::kExp);
  DensityControl control(context, options, 1.0, 11);
  accumulate(context, control, gaussians, views);
  CHECK(control.refine(gaussians, 20).hardly_seen == 0);
}

TEST_CASE("growth that has one pass alone reaches the limit in it [small] [tiny]") {
  Context context(test_device());
  DeviceGaussians gaussians = DeviceGaussians::upload(
      context, model_of({0.1, 0.1, 0.1}, {0.9, 0.9, 0.9}), ScaleActivation::kExp);
  DensityControl control(context, growth(50, 50, 5), 1.0, 7);
  accumulate(context, control, gaussians, Views::alike(3));
  control.refine(gaussians, 50);
  CHECK(gaussians.count == 5);
}

TEST_CASE("halves lie side by side along the longest axis, fainter and smaller [small] [tiny]") {
  Context context(test_device());
  const TrainOptions options = growth(10, 90, 6);
  for (const ScaleActivation activation : {ScaleActivation::kExp, ScaleActivation::kSigmoid}) {
    const Gaussians before = model_of({0.2, 0.3, 0.25}, {0.5, 0.9, 0.2});
    DeviceGaussians gaussians = DeviceGaussians::upload(context, before, activation);
    DensityControl control(context, options, 1.0, 1);
    accumulate(context, control, gaussians, Views::alike(3));
    const DensityPlan plan = control.refine(gaussians, 90);
    REQUIRE(plan.split == 3);
    const Gaussians after = gaussians.download();
    for (std::size_t i = 0; i < 6; ++i) {
      const std::size_t s = plan.source[i];
      const auto opacity = [](float x) { return 1.0 / (1.0 + std::exp(-static_cast<double>(x))); };
      CHECK(opacity(after.opacities[i]) ==
            doctest::Approx(0.6 * opacity(before.opacities[s])).epsilon(1e-4));
      // Axis 0 is the longest in model_of().
      const double longest = std::exp(static_cast<double>(before.log_scales[3 * s]));
      double squared = 0;
      for (std::size_t a = 0; a < 3; ++a) {
        const double size = std::exp(static_cast<double>(before.log_scales[3 * s + a]));
        CHECK(std::exp(static_cast<double>(after.log_scales[3 * i + a])) ==
              doctest::Approx((a == 0 ? 0.5 : 0.85) * size).epsilon(1e-4));
        squared +=
            std::pow(static_cast<double>(after.means[3 * i + a]) - before.means[3 * s + a], 2);
      }
      CHECK(std::sqrt(squared) == doctest::Approx(0.5 * longest).epsilon(1e-3));
    }
    // Both sides of each parent.
    for (std::size_t i = 0; i < 6; ++i) {
      for (std::size_t k = i + 1; k < 6; ++k) {
        if (plan.source[i] != plan.source[k]) continue;
        for (std::size_t a = 0; a < 3; ++a) {
          CHECK(0.5 * (after.means[3 * i + a] + after.means[3 * k + a]) ==
                doctest::Approx(before.means[3 * plan.source[i] + a]).epsilon(1e-3));
        }
      }
    }
  }
}

TEST_CASE(
    "fading takes the same off every opacity but leaves what is faint already [small] [tiny]") {
  Context context(test_device());
  TrainOptions options = growth(10, 50, 3);
  options.replace_until = 90;
  options.prune_opacity = 0;
  options.opacity_decay = 0.1;
  DeviceGaussians gaussians = DeviceGaussians::upload(
      context, model_of({0.1, 0.1, 0.1}, {0.9, 0.05, 0.002}), ScaleActivation::kExp);
  DensityControl control(context, options, 1.0, 1);
  accumulate(context, control, gaussians, Views::alike(3));
  const DensityPlan plan = control.refine(gaussians, 80);
  CHECK(!plan.changes());
  const std::vector<float> logits = gaussians.opacities.download();
  const auto opacity = [&logits](std::size_t i) { return 1.0 / (1.0 + std::exp(-logits[i])); };
  CHECK(opacity(0) == doctest::Approx(0.8).epsilon(1e-4));
  CHECK(opacity(1) == doctest::Approx(0.004).epsilon(1e-3));
  CHECK(opacity(2) == doctest::Approx(0.002).epsilon(1e-3));
}
