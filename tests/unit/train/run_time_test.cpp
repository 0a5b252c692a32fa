// SPDX-License-Identifier: Apache-2.0
#include "train/run_time.hpp"

#include <doctest/doctest.h>

#include <vector>

#include "raysplats/error.hpp"
#include "train/schedule.hpp"

using namespace raysplats;

namespace {

constexpr double kSpeed = 4e-7;  // seconds of a unit of work

StepSample sample(double pixels, double gaussians, double hits, double slower = 1.0) {
  return {pixels, gaussians, hits, slower * kSpeed * step_work(pixels, gaussians, hits)};
}

}  // namespace

TEST_CASE(
    "the speed of a device is that of its large steps, slow single ones aside [small] [tiny]") {
  std::vector<StepSample> timed;
  for (const double gaussians : {4000.0, 9000.0, 30000.0}) {
    timed.push_back(sample(96000, gaussians, 4e6));
    timed.push_back(sample(6000, gaussians, 2e5, 2.0));  // small ones have costs of their own
  }
  CHECK(seconds_per_work(timed) == doctest::Approx(kSpeed).epsilon(1e-9));
  timed.push_back(sample(96000, 9000, 4e6, 30.0));
  timed.push_back(sample(96000, 9000, 4e6));
  CHECK(seconds_per_work(timed) == doctest::Approx(kSpeed).epsilon(1e-9));
  CHECK(seconds_per_work(std::vector<StepSample>{sample(6000, 10, 0, 3.0)}) ==
        doctest::Approx(3 * kSpeed));
  CHECK_THROWS_AS(seconds_per_work({}), UsageError);
  CHECK_THROWS_AS(seconds_per_work(std::vector<StepSample>{{1, 1, 1, 0}}), UsageError);
}

TEST_CASE("the work of steps that were measured is found within a tenth [small] [tiny]") {
  // Steps at full size of trained captures: pixels, Gaussians, hits per pixel, milliseconds of two
  // cores together; the fox, a can, the fox without points, a room, DTU, lego, a kitchen.
  const double measured[][4] = {{32400, 25535, 53, 31.0},   {14400, 17044, 56.5, 17.1},
                                {32400, 25504, 140, 52.0},  {19200, 19718, 64, 20.3},
                                {30000, 24455, 45.5, 31.4}, {40000, 15615, 18.5, 23.4},
                                {26800, 23273, 49.5, 28.3}};
  constexpr double kMeasuredSpeed = 4.55e-4;  // milliseconds of a unit of work there
  for (const auto& [pixels, gaussians, hits, milliseconds] : measured) {
    CAPTURE(milliseconds);
    const double expected = kMeasuredSpeed * step_work(pixels, gaussians, hits * pixels);
    CHECK(expected > 0.88 * milliseconds);
    CHECK(expected < 1.16 * milliseconds);
  }
}

TEST_CASE("hits rise to what trained models have [small] [tiny]") {
  const HitCurve thin = expected_hits(9, 8, 1.0);
  CHECK(thin.first == 9);
  CHECK(thin.last > 40);
  const HitCurve dense = expected_hits(190, 135, 1.0);
  CHECK(dense.last > 135);
  CHECK(dense.last < 170);
  CHECK(expected_hits(9, 8, 0.25).last == doctest::Approx(0.25 * thin.last));
}

TEST_CASE("the work of a run is that of its steps, and iterations are found for seconds [small]") {
  TrainOptions options;
  options.iterations = 1000;
  const HitCurve hits{20, 60};
  double sum = 0;
  for (std::int64_t i = 0; i < options.iterations; ++i) {
    const double divisor = resolution_divisor(options, i);
    const double rays = 96000 / (divisor * divisor);
    // Full size from 0.4 of the run on.
    const double per_pixel = i < 400 ? 20 + 40.0 * static_cast<double>(i) / 400 : 60;
    sum += step_work(rays, expected_gaussians(options, i, 3000, 40000), rays * per_pixel);
  }
  CHECK(run_work(options, 96000, hits, 3000, 40000) == doctest::Approx(sum).epsilon(0.01));
  CHECK(expected_gaussians(options, 0, 3000, 40000) == 3000);
  CHECK(expected_gaussians(options, 999, 3000, 40000) == 40000);
  CHECK(expected_gaussians(options, 999, 50000, 40000) == 50000);
  const auto seconds = [&](std::int64_t n) {
    TrainOptions other = options;
    other.iterations = n;
    return kSpeed * run_work(other, 96000, hits, 3000, 40000);
  };
  const std::int64_t found = iterations_within(20, 10, seconds);
  CHECK(seconds(found) <= 20);
  CHECK(seconds(found) > 19.5);
  CHECK(iterations_within(0, 10, seconds) == 10);

  TrainOptions flat = options;
  flat.resolution_schedule.clear();
  flat.densify_until = 0;
  CHECK(run_work(flat, 100, {1, 50}, 10, 10) ==
        doctest::Approx(1000 * step_work(100, 10, 50 * 100)).epsilon(1e-6));
}
