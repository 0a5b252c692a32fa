// SPDX-License-Identifier: Apache-2.0
#include "train/run_time.hpp"

#include <doctest/doctest.h>

#include <vector>

#include "raysplats/error.hpp"
#include "raysplats/gaussians.hpp"
#include "train/schedule.hpp"

using namespace raysplats;

namespace {

constexpr double kSpeed = 4e-7;  // seconds of a unit of work

StepSample sample(double pixels, double gaussians, double hits, double slower = 1.0) {
  const StepLoad load{pixels, gaussians, 16, hits, 1.2 * gaussians};
  return {load, slower * kSpeed * step_work(load)};
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
  CHECK_THROWS_AS(seconds_per_work(std::vector<StepSample>{{{1, 1, 1, 1, 1}, 0}}), UsageError);
}

TEST_CASE("the work of steps that were measured is found within a twelfth [small] [tiny]") {
  // Steps at full size of trained captures: pixels, Gaussians, hits per pixel, candidates,
  // milliseconds of two cores together.
  struct Measured {
    double pixels, gaussians, hits, candidates, milliseconds;
  };
  const Measured measured[] = {{40000, 15615, 19.2, 24940, 26.7},   // lego
                               {160000, 18728, 20.3, 44761, 58.7},  // and larger
                               {32400, 22910, 50.5, 27807, 37.0},   // the fox
                               {8160, 18179, 52.3, 17323, 19.8},    // and smaller
                               {32400, 22909, 138.5, 38292, 67.8},  // and without points
                               {14400, 17044, 57.7, 15296, 20.9},   // a can
                               {57600, 21543, 27.6, 25730, 35.5},   // and larger
                               {46128, 27322, 58.5, 33262, 50.4},   // a plush toy
                               {11970, 15569, 67.1, 19712, 22.4},   // horns
                               {19200, 19718, 63.9, 13603, 24.2},   // a room
                               {4800, 6968, 48.1, 4552, 7.5},       // and through a fisheye
                               {30000, 22028, 41.7, 29594, 33.1},   // DTU 24
                               {26800, 20817, 48.1, 25983, 31.5},   // a kitchen
                               {18000, 16847, 55.7, 18110, 22.4},   // a train
                               {26600, 16355, 37.4, 20846, 25.3}};  // a statue
  constexpr double kMeasuredSpeed = 3.16e-4;  // milliseconds of a unit of work there
  for (const Measured& m : measured) {
    CAPTURE(m.milliseconds);
    const double expected =
        kMeasuredSpeed * step_work({m.pixels, m.gaussians, 16, m.hits * m.pixels, m.candidates});
    CHECK(expected > 0.92 * m.milliseconds);
    CHECK(expected < 1.08 * m.milliseconds);
  }
}

TEST_CASE("a run by time ends with its time, and has some last steps at any rate [small]") {
  // As planned, faster, and so fast that twice the iterations would not do.
  CHECK(fitted_end({700, 70, 0.1}, 1000, 100) == 1000);
  CHECK(fitted_end({700, 40, 0.05}, 1000, 100) == 1900);
  CHECK(fitted_end({700, 5, 0.01}, 1000, 100) == 2000);
  // Slower: with 9 s left, with 1 s, and beyond its time, where 7 s of 100 are taken on.
  CHECK(fitted_end({700, 91, 0.125}, 1000, 100) == 772);
  CHECK(fitted_end({700, 99, 0.125}, 1000, 100) == 756);
  CHECK(fitted_end({700, 130, 0.125}, 1000, 100) == 756);
  // No more than were planned, and one where a step takes longer than that.
  CHECK(fitted_end({980, 130, 0.125}, 1000, 100) == 1000);
  CHECK(fitted_end({700, 130, 25}, 1000, 100) == 701);
}

TEST_CASE("rates rise to what trained models have [small] [tiny]") {
  const double usual = trained_hits(8, {});
  CHECK(usual > 40);
  CHECK(trained_hits(usual, {}) == doctest::Approx(usual));
  CHECK(trained_hits(4 * usual, {}) == doctest::Approx(2 * usual));
  const double of_body = trained_hits(8, 1.0);
  CHECK(of_body < usual);
  CHECK(trained_hits(8, 0.25) == doctest::Approx(0.25 * of_body));
  CHECK(trained_hits(0, {}) == 0);
  const RateCurve rates = expected_rates({9, 0.5}, {75, 1}, 80);
  CHECK(rates.first.hits == 9);
  CHECK(rates.first.candidates == 0.5);
  CHECK(rates.last.hits == 80);
  CHECK(rates.last.candidates >= 1);
  CHECK(rates.last.candidates < 1.3);
  const LoadRates both =
      LoadRates::of(std::vector<StepSample>{{{100, 10, 1, 300, 5}, 1}, {{300, 30, 1, 500, 15}, 1}});
  CHECK(both.hits == doctest::Approx(2));
  CHECK(both.candidates == doctest::Approx(0.5));
}

TEST_CASE("the work of a run is that of its steps, and iterations are found for seconds [small]") {
  TrainOptions options;
  options.iterations = 1000;
  const RateCurve rates{{20, 0.8}, {60, 1.2}};
  double sum = 0;
  for (std::int64_t i = 0; i < options.iterations; ++i) {
    const double divisor = resolution_divisor(options, i);
    const double rays = 96000 / (divisor * divisor);
    // Full size from 0.4 of the run on.
    const double risen = i < 400 ? static_cast<double>(i) / 400 : 1.0;
    const double gaussians = expected_gaussians(options, i, 3000, 40000);
    const auto bases = static_cast<double>(sh_coefficients(active_sh_degree(options, i)));
    sum += step_work(
        {rays, gaussians, bases, rays * (20 + 40 * risen), gaussians * (0.8 + 0.4 * risen)});
  }
  CHECK(run_work(options, 96000, rates, 3000, 40000) == doctest::Approx(1.1 * sum).epsilon(0.01));
  CHECK(expected_gaussians(options, 0, 3000, 40000) == 3000);
  CHECK(expected_gaussians(options, 999, 3000, 40000) == 40000);
  CHECK(expected_gaussians(options, 999, 50000, 40000) == 50000);
  const auto seconds = [&](std::int64_t n) {
    TrainOptions other = options;
    other.iterations = n;
    return kSpeed * run_work(other, 96000, rates, 3000, 40000);
  };
  const std::int64_t found = iterations_within(200, 10, seconds);
  CHECK(seconds(found) <= 200);
  CHECK(seconds(found) > 199);
  CHECK(iterations_within(0, 10, seconds) == 10);

  TrainOptions flat = options;
  flat.resolution_schedule.clear();
  flat.densify_until = 0;
  flat.sh_degree = 0;
  CHECK(run_work(flat, 100, {{1, 0}, {50, 1}}, 10, 10) ==
        doctest::Approx(1.1 * 1000 * step_work({100, 10, 1, 50 * 100, 10})).epsilon(1e-6));
}
