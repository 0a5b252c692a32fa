// SPDX-License-Identifier: Apache-2.0
#include "scene/gaussians/model_summary.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "scene/statistics.hpp"
#include "util/rng.hpp"

using namespace raysplats;

TEST_CASE("weighted quantile weighs, and falls back to equal weights") {
  const std::array<double, 4> values{4, 1, 3, 2};
  const std::array<double, 4> weights{0, 1, 8, 1};
  CHECK(weighted_quantile(values, weights, 0.5) == 3.0);
  CHECK(weighted_quantile(values, weights, 0.05) == 1.0);
  const std::array<double, 4> zero{};
  CHECK(weighted_quantile(values, zero, 0.5) == 2.0);
  CHECK(weighted_quantile({}, {}, 0.5) == 0.0);
  const std::array<double, 3> q{0.0, 0.5, 1.0};
  CHECK(quantiles({3, 1, 2, 10}, q) == std::vector<double>{1.0, 2.5, 10.0});
}

TEST_CASE("quantiles in any order are those of the sorted values") {
  CounterRng rng(5, 1);
  std::vector<double> values;
  for (int i = 0; i < 1000; ++i) values.push_back(static_cast<double>(rng.below(300)));
  std::vector<double> sorted = values;
  std::sort(sorted.begin(), sorted.end());
  const std::array<double, 6> q{0.25, 0.9, 0.5, 0.5, 1.0, 0.0};
  const std::vector<double> found = quantiles(values, q);
  for (std::size_t k = 0; k < q.size(); ++k) {
    const double at = q[k] * 999.0;
    const auto low = static_cast<std::size_t>(at);
    const double high = sorted[std::min<std::size_t>(low + 1, 999)];
    CHECK(found[k] == doctest::Approx(sorted[low] + (at - std::floor(at)) * (high - sorted[low])));
  }
  CHECK(quantiles({}, q) == std::vector<double>(6, 0.0));
  CHECK(quantiles({7.0}, q) == std::vector<double>(6, 7.0));
}

TEST_CASE("a model's summary counts what is there") {
  Gaussians model;
  model.sh_degree = 1;
  model.resize(4);
  for (std::size_t i = 0; i < 4; ++i) {
    model.means[3 * i] = static_cast<float>(i);
    model.log_scales[3 * i] = std::log(8.0f);
    model.log_scales[3 * i + 1] = std::log(2.0f);
    model.log_scales[3 * i + 2] = std::log(4.0f);
  }
  model.opacities = {-10.0f, 0.0f, 10.0f, 10.0f};
  const ModelSummary summary = summarize(model);
  CHECK(summary.count == 4);
  CHECK(summary.sh_degree == 1);
  CHECK(summary.minimum[0] == 0.0);
  CHECK(summary.maximum[0] == 3.0);
  CHECK(summary.scale_quantiles[0] == doctest::Approx(2.0));
  CHECK(summary.scale_quantiles[2] == doctest::Approx(4.0));
  CHECK(summary.scale_quantiles[4] == doctest::Approx(8.0));
  CHECK(summary.median_anisotropy == doctest::Approx(4.0));
  CHECK(summary.opacity_histogram[0] == 1);
  CHECK(summary.opacity_histogram[5] == 1);
  CHECK(summary.opacity_histogram[9] == 2);
  CHECK(summary.mean_opacity == doctest::Approx(0.625).epsilon(1e-4));
  CHECK(summarize(Gaussians{}).count == 0);
}
