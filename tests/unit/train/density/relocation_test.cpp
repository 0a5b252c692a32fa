// SPDX-License-Identifier: Apache-2.0
#include "train/density/relocation.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <limits>
#include <map>

using namespace raysplats;

namespace {

float logit(double x) { return static_cast<float>(std::log(x / (1 - x))); }

// The sum as it stands in the paper, term by term.
double double_sum(double part, int n) {
  double sum = 0;
  for (int i = 1; i <= n; ++i) {
    double binomial = 1;  // C(i - 1, k)
    for (int k = 0; k < i; ++k) {
      sum += binomial * (k % 2 == 0 ? 1 : -1) * std::pow(part, k + 1) / std::sqrt(k + 1.0);
      binomial *= static_cast<double>(i - 1 - k) / (k + 1);
    }
  }
  return sum;
}

// What a ray through the middle loses: 1 - (1 - part)^n of parts that lie in one place, summed over
// a slice through them as it widens; the integral over the line is what the correction keeps.
double integral(double opacity, double scale, int n) {
  double sum = 0;
  constexpr int kSteps = 4000;
  for (int i = 0; i < kSteps; ++i) {
    const double x = 8.0 * (i + 0.5) / kSteps;
    const double alpha = opacity * std::exp(-0.5 * x * x / (scale * scale));
    sum += (1 - std::pow(1 - alpha, n)) * 8.0 / kSteps;
  }
  return sum;
}

struct Model {
  std::vector<float> means, scales, opacities;
  explicit Model(const std::vector<double>& given) {
    for (std::size_t i = 0; i < given.size(); ++i) {
      for (int a = 0; a < 3; ++a) {
        means.push_back(static_cast<float>(i) + 0.1f * static_cast<float>(a));
        scales.push_back(-2.0f);
      }
      opacities.push_back(logit(given[i]));
    }
  }
  RelocationPlan plan(const RelocationRules& rules) const {
    return plan_relocation(means, scales, opacities, rules);
  }
};

std::map<std::uint32_t, std::size_t> parts_of(const RelocationPlan& plan) {
  std::map<std::uint32_t, std::size_t> out;
  for (const std::uint32_t source : plan.density.source) ++out[source];
  return out;
}

}  // namespace

TEST_CASE("equal shares together have the opacity and the integral of the whole [tiny]") {
  for (const double opacity : {0.02, 0.3, 0.8, 0.99}) {
    for (const int n : {1, 2, 3, 7}) {
      CAPTURE(opacity);
      CAPTURE(n);
      const EqualShare share = equal_share(opacity, static_cast<std::size_t>(n));
      const double part = 1 - std::pow(1 - opacity, 1.0 / n);
      CHECK(share.scale == doctest::Approx(opacity / double_sum(part, n)).epsilon(1e-9));
      if (part < 0.005) continue;
      CHECK(1 - std::pow(1 - share.opacity, n) == doctest::Approx(opacity).epsilon(1e-9));
      CHECK(integral(share.opacity, share.scale, n) ==
            doctest::Approx(integral(opacity, 1, 1)).epsilon(1e-3));
    }
  }
  CHECK(equal_share(0.5, 1).scale == doctest::Approx(1));
  CHECK(equal_share(0.5, 1000).scale == doctest::Approx(equal_share(0.5, 51).scale));
  CHECK(equal_share(0.006, 10).opacity == 0.005);
}

TEST_CASE("what is dead becomes parts of what is alive, and the count grows to its target [tiny]") {
  Model model({0.5, 0.001, 0.9, 0.002, 0.3});
  model.scales[3 * 4] = std::numeric_limits<float>::quiet_NaN();
  RelocationRules rules;
  rules.target = 7;
  rules.seed = 5;
  const RelocationPlan plan = model.plan(rules);
  CHECK(plan.density.pruned == 3);
  CHECK(plan.density.faint == 2);
  CHECK(plan.density.not_finite == 1);
  CHECK(plan.density.cloned == 5);
  REQUIRE(plan.density.source.size() == 7);
  REQUIRE(plan.shares.size() == 7);
  auto parts = parts_of(plan);
  CHECK(parts[0] + parts[2] == 7);
  for (std::size_t i = 0; i < 7; ++i) {
    const std::uint32_t source = plan.density.source[i];
    const bool shared = parts[source] > 1;
    CHECK((plan.density.role[i] == static_cast<std::uint32_t>(DensityRole::kKeep)) == !shared);
    const EqualShare share = equal_share(source == 0 ? 0.5 : 0.9, parts[source]);
    CHECK(plan.shares[i][1] == doctest::Approx(shared ? share.scale : 0));
    if (shared) CHECK(plan.shares[i][0] == doctest::Approx(logit(share.opacity)));
  }
  CHECK(model.plan(rules).density.source == plan.density.source);

  rules.target = 0;  // no fewer than before
  CHECK(model.plan(rules).density.source.size() == 5);
  rules.bounds = Bounds{{-1, -1, -1}, {1, 1, 1}};
  const RelocationPlan inside = model.plan(rules);
  CHECK(inside.density.outside == 3);
  CHECK(parts_of(inside).size() == 1);
  rules.bounds = Bounds{{50, 50, 50}, {51, 51, 51}};
  CHECK(model.plan(rules).density.source.empty());
}

TEST_CASE("parts are drawn in proportion to opacity") {
  const Model model({0.1, 0.4, 0.8});
  RelocationRules rules;
  rules.target = 13003;
  rules.seed = 9;
  auto parts = parts_of(model.plan(rules));
  CHECK(static_cast<double>(parts[0]) == doctest::Approx(1000).epsilon(0.1));
  CHECK(static_cast<double>(parts[1]) == doctest::Approx(4000).epsilon(0.05));
  CHECK(static_cast<double>(parts[2]) == doctest::Approx(8000).epsilon(0.05));
  rules.seed = 10;
  CHECK(parts_of(model.plan(rules)) != parts);
}
