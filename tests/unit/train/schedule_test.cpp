// SPDX-License-Identifier: Apache-2.0
#include "train/schedule.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <numeric>
#include <set>
#include <utility>
#include <vector>

#include "train/step_options.hpp"
#include "util/rng.hpp"

using namespace raysplats;

TEST_CASE("learning rates decay to their final value") {
  TrainOptions options;
  options.iterations = 101;
  const LearningRate rate{1e-2, 1e-4};
  CHECK(learning_rate(rate, options, 0) == doctest::Approx(1e-2));
  CHECK(learning_rate(rate, options, 50) == doctest::Approx(1e-3));
  CHECK(learning_rate(rate, options, 100) == doctest::Approx(1e-4));
  CHECK(learning_rate(rate, options, 500) == doctest::Approx(1e-4));
  CHECK(learning_rate({0, 0}, options, 3) == 0.0);
  options.lr_decay = 8.6643e-5;
  CHECK(learning_rate({5e-3, 1e-3}, options, 10000) == doctest::Approx(5e-3 * std::exp(-0.86643)));
  CHECK(learning_rate({5e-3, 1e-3}, options, 30000) == doctest::Approx(1e-3));
  CHECK(learning_rate({5e-2, 5e-2}, options, 30000) == doctest::Approx(5e-2));
}

TEST_CASE("a run is as long as it is told, or as its photos ask for") {
  TrainOptions options;
  CHECK(run_length(options, 1) == 1000);
  CHECK(run_length(options, 21) == 2100);
  CHECK(run_length(options, 500) == 10000);
  options.iterations = 0;
  CHECK(run_length(options, 21) == 0);
  options.iterations = 48000;
  CHECK(run_length(options, 21) == 48000);
}

TEST_CASE("rates that fit the run fall with the root of its length, and given ones stay") {
  TrainOptions options;
  const auto rates_of = [&options](std::int64_t iterations) {
    options.iterations = iterations;
    const LearningRate scale = scale_rate(options), rest = sh_rest_rate(options);
    return std::vector<double>{scale.initial, scale.final_value, rest.initial, rest.final_value};
  };
  const auto check = [](const std::vector<double>& found, const std::vector<double>& expected) {
    for (std::size_t k = 0; k < 4; ++k) CHECK(found[k] == doctest::Approx(expected[k]));
  };
  check(rates_of(1000), {0.08, 0.01, 0.003, 0.001});
  check(rates_of(500), {0.08 * std::sqrt(2.0), 0.01 * std::sqrt(2.0), 0.003, 0.001});
  check(rates_of(0), {0.12, 0.02, 0.003, 0.001});
  check(rates_of(4000), {0.04, 0.005, 0.0015, 0.0005});
  check(rates_of(1000000), {0.04, 0.005, 0.0005, 0.000125});
  CHECK(adam_rates_of(options, 2.0, 2.0, 0).scales == doctest::Approx(0.04));
  CHECK(adam_rates_of(options, 2.0, 2.0, 0).sh_rest == doctest::Approx(0.0005));

  options.scale_lr = {0.01, 0.002};
  options.sh_rest_lr = {0, kFitted};
  check(rates_of(1000), {0.01, 0.002, 0, 0});
  options.scale_lr = {kFitted, 0.5};
  options.sh_rest_lr = {kFitted, 0.01};
  check(rates_of(1000), {0.5, 0.5, 0.01, 0.01});
  options.scale_lr = {0.001, kFitted};
  options.sh_rest_lr = {0.0002, kFitted};
  check(rates_of(1000), {0.001, 0.001, 0.0002, 0.0002});
}

TEST_CASE("rates of colours shrink with the range that photos take, as far as it is small") {
  TrainOptions options;
  options.iterations = 1000;
  const AdamRates usual = adam_rates_of(options, 2.0, 2.0, 0);
  for (const double range : {0.8, 1.0, 20.0}) {
    options.color_range = range;
    CHECK(adam_rates_of(options, 2.0, 2.0, 0).sh_dc == usual.sh_dc);
  }
  options.color_range = 0.08;
  const AdamRates fog = adam_rates_of(options, 2.0, 2.0, 999);
  options.color_range = 0;
  const AdamRates last = adam_rates_of(options, 2.0, 2.0, 999);
  CHECK(fog.sh_dc == doctest::Approx(0.1 * last.sh_dc));
  CHECK(fog.sh_rest == doctest::Approx(0.1 * last.sh_rest));
  CHECK(fog.means == last.means);
  CHECK(fog.opacities == last.opacities);
}

TEST_CASE("the last rates fall with the root of the run's length, unless they are given") {
  TrainOptions options;
  const auto check_last = [&options](std::int64_t iterations, double rotation, double opacity,
                                     double sh, double position) {
    CAPTURE(iterations);
    options.iterations = iterations;
    const AdamRates last = adam_rates_of(options, 2.0, 2.0, iterations - 1);
    CHECK(last.quaternions == doctest::Approx(rotation));
    CHECK(last.opacities == doctest::Approx(opacity));
    CHECK(last.sh_dc == doctest::Approx(sh));
    CHECK(last.means == doctest::Approx(2.0 * position));
    CHECK(adam_rates_of(options, 2.0, 2.0, 0).opacities == doctest::Approx(0.1));
  };
  check_last(100, 0.003, 0.1, 0.01, 2e-5);
  check_last(1000, 0.003, 0.06, 0.005, 1e-5);
  check_last(2000, 0.003 / std::sqrt(2.0), 0.06 / std::sqrt(2.0), 0.005 / std::sqrt(2.0),
             1e-5 / std::sqrt(2.0));
  check_last(30000, 0.001, 0.03, 0.0025, 5e-6);
  options.rotation_lr.final_value = options.opacity_lr.final_value = 0.002;
  options.sh_lr.final_value = options.position_lr.final_value = 0.0001;
  check_last(30000, 0.002, 0.002, 0.0001, 0.0001);
}

TEST_CASE("stretches of steps show all views where they are passes, or as long as two") {
  CounterRng rng(3, 0);
  for (std::int64_t views = 1; views <= 9; ++views) {
    std::vector<std::int64_t> turns;
    for (int pass = 0; pass < 800; ++pass) {
      std::vector<std::int64_t> order(static_cast<std::size_t>(views));
      std::iota(order.begin(), order.end(), 0);
      for (std::size_t i = order.size(); i > 1; --i) std::swap(order[i - 1], order[rng.below(i)]);
      turns.insert(turns.end(), order.begin(), order.end());
    }
    for (std::int64_t together = 1; together <= 4; ++together) {
      CHECK(pass_steps(views, together) * together >= views);
      CHECK((pass_steps(views, together) - 1) * together < views);
      for (std::int64_t steps = 1; steps <= 20; ++steps) {
        const auto length = static_cast<std::size_t>(steps * together);
        bool all = true;
        for (std::size_t at = 0; at + length <= turns.size(); at += length) {
          const auto begin = turns.begin() + static_cast<std::ptrdiff_t>(at);
          const std::set<std::int64_t> seen(begin, begin + static_cast<std::ptrdiff_t>(length));
          all = all && seen.size() == static_cast<std::size_t>(views);
        }
        CAPTURE(views);
        CAPTURE(together);
        CAPTURE(steps);
        CHECK((all || !shows_all(steps, views, together)));
      }
    }
  }
  CHECK(shows_all(150, 300, 2));
  CHECK(!shows_all(151, 301, 2));
  CHECK(shows_all(302, 301, 2));
  CHECK(!shows_all(2, 3, 1));
}

TEST_CASE("a run that is long for its photos takes off opacities") {
  TrainOptions options;
  for (const auto& [steps, decay] :
       {std::pair{0, 0.0}, {1000, 0.0}, {2100, 0.0}, {3150, 0.005}, {4200, 0.01}, {48000, 0.01}}) {
    options.iterations = steps;
    CHECK(pass_decay(options, 21) == doctest::Approx(decay));
  }
  CHECK(pass_decay(options, 480) == 0.0);
  options.init = "random";
  CHECK(pass_decay(options, 480) == 0.01);
  options.opacity_decay = 0.02;
  CHECK(pass_decay(options, 21) == 0.02);
}

TEST_CASE("a random start has its own rate, opacity and decay unless they are given") {
  TrainOptions options;
  CHECK(position_rate(options).initial == 5e-4);
  CHECK(start_opacity(options) == 0.1);
  CHECK(pass_decay(options, 50) == 0.0);
  options.init = "random";
  CHECK(position_rate(options).initial == 2e-3);
  options.iterations = 1000;
  CHECK(position_rate(options).final_value == 1e-5);
  CHECK(adam_rates_of(options, 3.0, 3.0, 0).means == doctest::Approx(6e-3));
  CHECK(start_opacity(options) == 0.02);
  CHECK(pass_decay(options, 50) == 0.01);
  options.strategy = DensityStrategy::kMcmc;
  CHECK(position_rate(options).initial == 5e-4);
  CHECK(start_opacity(options) == 0.1);
  CHECK(pass_decay(options, 50) == 0.0);
  options.strategy = DensityStrategy::kAdc;
  CHECK(start_opacity(options) == 0.02);
  options.position_lr = {1e-3, 1e-4};
  options.init_opacity = 0.3;
  options.opacity_decay = 0;
  CHECK(position_rate(options).initial == 1e-3);
  CHECK(start_opacity(options) == 0.3);
  CHECK(pass_decay(options, 50) == 0.0);
  options.position_lr = {kFitted, 0.01};
  CHECK(position_rate(options).initial == 0.01);
}

TEST_CASE("bands and resolution are switched on over time") {
  TrainOptions options;
  options.sh_degree = 2;
  options.sh_degree_interval = 10;
  CHECK(active_sh_degree(options, 9) == 0);
  CHECK(active_sh_degree(options, 10) == 1);
  CHECK(active_sh_degree(options, 500) == 2);
  options.sh_degree_interval = 0;
  CHECK(active_sh_degree(options, 0) == 2);
  options.resolution_schedule = {};
  CHECK(resolution_divisor(options, 0) == 1);
  options.resolution_schedule = {{4, 100}, {2, 300}};
  CHECK(resolution_divisor(options, 0) == 4);
  CHECK(resolution_divisor(options, 99) == 4);
  CHECK(resolution_divisor(options, 100) == 2);
  CHECK(resolution_divisor(options, 300) == 1);
}

TEST_CASE("values below 1 are shares of the run, others iterations") {
  CHECK(RunShare(0.4).of(1000) == 400);
  CHECK(RunShare(0.4).of(10) == 4);
  CHECK(RunShare(1e-6).of(10) == 1);
  CHECK(RunShare(1).of(1000) == 1);
  CHECK(RunShare(300).of(100) == 300);
  CHECK(RunShare(0).of(100) == 0);
}

TEST_CASE(
    "runs of every length see full-size photos, all bands and no density control at their end") {
  for (const std::int64_t iterations : {100, 1000, 2000, 10000, 30000}) {
    INFO(iterations);
    TrainOptions options;
    options.iterations = iterations;
    CHECK(resolution_divisor(options, 0) == 4);
    CHECK(resolution_divisor(options, iterations * 6 / 10) == 1);
    CHECK(active_sh_degree(options, 0) == 0);
    CHECK(active_sh_degree(options, iterations / 2) == options.sh_degree);
    CHECK(options.densify_until.of(iterations) < iterations);
    CHECK(options.replace_until.of(iterations) < iterations);
    int last = 64;
    for (std::int64_t i = 0; i < iterations; i += iterations / 100) {
      CHECK(resolution_divisor(options, i) <= last);
      last = resolution_divisor(options, i);
    }
  }
}

TEST_CASE("every pass sees every view once, in another order, and a new object continues it") {
  ViewOrder order(1, 20);
  std::vector<std::size_t> first, second;
  for (int i = 0; i < 20; ++i) first.push_back(order.at(i));
  for (int i = 20; i < 40; ++i) second.push_back(order.at(i));
  CHECK(std::set<std::size_t>(first.begin(), first.end()).size() == 20);
  CHECK(std::set<std::size_t>(second.begin(), second.end()).size() == 20);
  CHECK(first != second);
  ViewOrder resumed(1, 20);
  CHECK(resumed.at(27) == second[7]);
  ViewOrder other(2, 20);
  std::vector<std::size_t> seeded;
  seeded.reserve(20);
  for (int i = 0; i < 20; ++i) seeded.push_back(other.at(i));
  CHECK(seeded != first);
}

TEST_CASE("photos are judged the more often the more steps a run has for each") {
  TrainOptions options;
  options.iterations = 600;
  const auto judged = [&](std::size_t photos) {
    std::vector<std::int64_t> out;
    for (std::int64_t i = 0; i <= options.iterations; ++i) {
      if (judges_photos_at(options, photos, i)) out.push_back(i);
    }
    return out;
  };
  using Iterations = std::vector<std::int64_t>;
  CHECK(judged(10) == Iterations{60, 120, 180, 240, 300});
  CHECK(judged(11) == Iterations{120, 240});
  CHECK(judged(41) == Iterations{180});
  CHECK(judged(101).empty());
  options.views_per_step = 2;
  CHECK(judged(101) == Iterations{180});
  options.poses = true;  // may mend them
  CHECK(judged(10).empty());
  options.poses = options.leave_out_odd = false;
  CHECK(judged(10).empty());
}

TEST_CASE("what moves is looked for from a fifth of a run on, with the option") {
  TrainOptions options;
  options.iterations = 600;
  const auto looked = [&](std::size_t photos) {
    std::vector<std::int64_t> out;
    for (std::int64_t i = 0; i <= options.iterations; ++i) {
      if (looks_for_motion_at(options, photos, i)) out.push_back(i);
    }
    return out;
  };
  using Iterations = std::vector<std::int64_t>;
  CHECK(looked(10).empty());
  options.leave_out_moving = true;
  CHECK(looked(10) == Iterations{120, 180, 240, 300});
  CHECK(looked(40) == Iterations{120, 180, 240, 300});
  CHECK(looked(41) == Iterations{120, 240});
  options.poses = true;
  options.leave_out_odd = false;
  CHECK(looked(10).size() == 4);
}

TEST_CASE("passes go on without views that are left out, from another iteration on") {
  const std::vector<std::size_t> odd{3, 4, 8}, apart{2, 7};
  for (const bool validates : {false, true}) {
    ViewOrder order = validates ? ViewOrder(1, 10, apart, 60) : ViewOrder(1, 10);
    const ViewOrder before = order;
    order.leave_out(odd, 33);
    ViewOrder plain = before;
    for (int i = 0; i < 33; ++i) CHECK(order.at(i) == plain.at(i));
    const int views = validates ? 5 : 7;
    std::multiset<std::size_t> seen, late;
    for (int i = 33; i < 33 + 4 * views; ++i) seen.insert(order.at(i));
    CHECK(seen.size() == static_cast<std::size_t>(4 * views));
    for (std::size_t view = 0; view < 10; ++view) {
      const bool shown =
          view != 3 && view != 4 && view != 8 && !(validates && (view == 2 || view == 7));
      CHECK(seen.count(view) == (shown ? 4 : 0));
    }
    const int begin = validates ? 60 : 61;  // of a pass
    for (int i = begin; i < begin + 14; ++i) late.insert(order.at(i));
    CHECK(late.count(3) + late.count(4) + late.count(8) == 0);
    CHECK(late.count(7) == 2);
    // Asked for out of turn, and by a new object that begins there.
    ViewOrder resumed = validates ? ViewOrder(1, 10, apart, 60) : ViewOrder(1, 10);
    resumed.leave_out(odd, 33);
    CHECK(resumed.at(70) == order.at(70));
    CHECK(resumed.at(5) == plain.at(5));
  }
}

TEST_CASE("validation views are evenly spread and come into the order late") {
  CHECK(validation_views(10, 2) == std::vector<std::size_t>{2, 7});
  CHECK(validation_views(10, 0).empty());
  CHECK(validation_views(4, 3).size() == 2);
  CHECK(validation_views(2, 1).empty());
  const std::vector<std::size_t> apart{2, 7};
  ViewOrder order(1, 10, apart, 20);
  std::multiset<std::size_t> before, after;
  for (int i = 0; i < 16; ++i) before.insert(order.at(i));
  for (int i = 16; i < 20; ++i) CHECK(order.at(i) % 5 != 2);
  for (int i = 20; i < 30; ++i) after.insert(order.at(i));
  for (std::size_t v = 0; v < 10; ++v) {
    CHECK(before.count(v) == (v % 5 == 2 ? 0 : 2));
    CHECK(after.count(v) == 1);
  }
  ViewOrder resumed(1, 10, apart, 20);
  CHECK(resumed.at(23) == order.at(23));
  CHECK(resumed.at(5) == order.at(5));
  // Without views apart the order is that of a run that knows of none.
  ViewOrder none(1, 10, {}, 20), plain(1, 10);
  for (int i = 0; i < 40; ++i) CHECK(none.at(i) == plain.at(i));
}

TEST_CASE("validation takes place every tenth of a run until its views join") {
  TrainOptions options;
  options.iterations = 1000;
  CHECK_FALSE(validates_at(options, 100));
  options.validate_views = 1;
  int times = 0;
  for (std::int64_t i = 1; i <= 1000; ++i) times += validates_at(options, i) ? 1 : 0;
  CHECK(times == 9);
  CHECK(validation_end(options) == 900);
  CHECK(validation_join(options) == 900);
  CHECK(validates_at(options, 900));
  CHECK_FALSE(validates_at(options, 1000));
  // With poses as often, though the views never join: not in the longest run that can be asked for.
  options.poses = true;
  CHECK(validates_at(options, 900));
  CHECK_FALSE(validates_at(options, 1000));
  CHECK(validation_join(options) > 1'000'000'000'000'000);
}

TEST_CASE("the evaluations and validations of a run are counted before it begins") {
  TrainOptions options;
  for (const std::int64_t iterations : {1, 7, 40, 1000}) {
    for (const std::int64_t every : {0, 1, 7, 500}) {
      for (const std::int64_t end : {0, 5}) {
        CAPTURE(iterations);
        CAPTURE(every);
        CAPTURE(end);
        options.iterations = iterations;
        options.end_iteration = end > iterations ? 0 : end;
        options.eval_every = every;
        options.eval_at = {0.5, 7, 21, 2000};
        options.validate_views = 2;
        std::set<std::int64_t> evaluated{last_iteration(options)};
        std::size_t validations = 0;
        for (std::int64_t i = 1; i <= last_iteration(options); ++i) {
          if (every > 0 && i % every == 0) evaluated.insert(i);
          for (const RunShare& share : options.eval_at) {
            if (share.of(iterations) == i) evaluated.insert(i);
          }
          validations += validates_at(options, i) ? 1 : 0;
        }
        CHECK(evaluation_count(options) == evaluated.size());
        CHECK(validation_count(options) == validations);
        options.validate_views = 0;
        CHECK(validation_count(options) == 0);
      }
    }
  }
}

TEST_CASE("a random background is a function of seed and iteration, for cut-out photos only") {
  TrainOptions options;
  const std::array<float, 3> white{1, 1, 1};
  CHECK(step_background(options, true, white, 5) == white);
  options.background = "random";
  const auto color = step_background(options, true, white, 5);
  CHECK(color == step_background(options, true, white, 5));
  CHECK(color != step_background(options, true, white, 6));
  for (const float c : color) CHECK((c >= 0.0f && c < 1.0f));
  CHECK(step_background(options, false, white, 5) == std::array<float, 3>{0, 0, 0});
}

TEST_CASE(
    "steps are alike once photos are whole, bands are on, the number of Gaussians no longer grows "
    "and flat ones are flat") {
  TrainOptions options;
  options.iterations = 1000;
  options.densify_until = 0.5;
  options.resolution_schedule = {{2, 0.3}};
  options.sh_degree_interval = 0.1;
  CHECK(steady_from(options) == 500);
  options.resolution_schedule = {{4, 0.3}, {2, 700}};
  CHECK(steady_from(options) == 700);
  options.sh_degree_interval = 0.25;
  CHECK(steady_from(options) == 750);
  options.flat = true;
  CHECK(steady_from(options) == 800);
  CHECK(flat_thickness(options, steady_from(options) - 1) == doctest::Approx(0.01));
  CHECK(timed_until(options) > 800);  // no run by time ends before it
  options.flat = false;
  CHECK(last_iteration(options) == 1000);
  options.end_iteration = 800;
  CHECK(last_iteration(options) == 800);
}

TEST_CASE("steps that are alike from the beginning are timed from the first one's end on") {
  TrainOptions options;
  options.iterations = 1000;
  options.densify_until = 0;
  options.resolution_schedule = {};
  options.sh_degree = 0;
  CHECK(steady_from(options) == 1);
  options.sh_degree = 3;
  options.sh_degree_interval = 0;
  CHECK(steady_from(options) == 1);
  CHECK(timed_until(options) > 1);
}
