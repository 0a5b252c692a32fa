// SPDX-License-Identifier: Apache-2.0
#include "train/run_time.hpp"

#include <doctest/doctest.h>

#include <vector>

#include "raysplats/error.hpp"
#include "train/schedule.hpp"

using namespace raysplats;

namespace {

constexpr StepCost kTrue{2e-3, 3e-7, 5e-7};

std::vector<StepSample> samples() {
  std::vector<StepSample> out;
  for (const double pixels : {6000.0, 10000.0, 24000.0, 96000.0}) {
    for (const double gaussians : {4000.0, 9000.0, 30000.0})
      out.push_back({pixels, gaussians, kTrue.seconds(pixels, gaussians)});
  }
  return out;
}

}  // namespace

TEST_CASE("the cost of a step is found again, slow single steps aside [small] [tiny]") {
  std::vector<StepSample> timed = samples();
  const auto check = [](const StepCost& cost) {
    CHECK(cost.fixed == doctest::Approx(kTrue.fixed).epsilon(1e-3));
    CHECK(cost.per_pixel == doctest::Approx(kTrue.per_pixel).epsilon(1e-3));
    CHECK(cost.per_gaussian == doctest::Approx(kTrue.per_gaussian).epsilon(1e-3));
  };
  check(fit_step_cost(timed));
  timed.push_back({24000, 9000, 30 * kTrue.seconds(24000, 9000)});
  check(fit_step_cost(timed));
  CHECK_THROWS_AS(fit_step_cost({}), UsageError);
  CHECK_THROWS_AS(fit_step_cost(std::vector<StepSample>{{1, 1, 0}}), UsageError);
}

TEST_CASE("no term of a cost is negative, and one size of step is enough [small] [tiny]") {
  // Faster with more Gaussians: noise, not a law.
  const StepCost odd = fit_step_cost(
      std::vector<StepSample>{{100, 10, 2.0}, {100, 20, 1.0}, {200, 30, 2.0}, {200, 40, 2.1}});
  CHECK(odd.fixed >= 0);
  CHECK(odd.per_pixel >= 0);
  CHECK(odd.per_gaussian >= 0);
  const StepCost single = fit_step_cost(std::vector<StepSample>{{100, 10, 2.0}, {100, 10, 2.0}});
  CHECK(single.seconds(100, 10) == doctest::Approx(2.0));
}

TEST_CASE(
    "the seconds of a run are those of its steps, and iterations are found for them [small]") {
  TrainOptions options;
  options.iterations = 1000;
  double sum = 0;
  for (std::int64_t i = 0; i < options.iterations; ++i) {
    const double divisor = resolution_divisor(options, i);
    sum += kTrue.seconds(96000 / (divisor * divisor), expected_gaussians(options, i, 3000, 40000));
  }
  CHECK(run_seconds(options, kTrue, 96000, 3000, 40000) == doctest::Approx(sum).epsilon(0.01));
  CHECK(expected_gaussians(options, 0, 3000, 40000) == 3000);
  CHECK(expected_gaussians(options, 999, 3000, 40000) == 40000);
  CHECK(expected_gaussians(options, 999, 50000, 40000) == 50000);
  const auto seconds = [&](std::int64_t n) {
    TrainOptions other = options;
    other.iterations = n;
    return run_seconds(other, kTrue, 96000, 3000, 40000);
  };
  const std::int64_t found = iterations_within(20, 10, seconds);
  CHECK(seconds(found) <= 20);
  CHECK(seconds(found) > 19.5);
  CHECK(iterations_within(0, 10, seconds) == 10);
}
