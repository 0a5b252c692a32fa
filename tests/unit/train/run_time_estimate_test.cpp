// SPDX-License-Identifier: Apache-2.0
// Trainer::estimate() and Trainer::fit_time().
#include <doctest/doctest.h>

#include <cmath>
#include <filesystem>
#include <string>

#include "raysplats/dataset.hpp"
#include "raysplats/device.hpp"
#include "raysplats/error.hpp"
#include "raysplats/trainer.hpp"
#include "run/train_config.hpp"
#include "unit/fixture.hpp"
#include "unit/log_capture.hpp"
#include "unit/train/short_training.hpp"

using namespace raysplats;
namespace fs = std::filesystem;

TEST_CASE("an estimate leaves no trace in the run, whatever its strategy and options") {
  const TemporaryDirectory folder;
  const fs::path data = folder.path() / "data";
  make_photos(data, 32, 8, 1);
  for (const DensityStrategy strategy :
       {DensityStrategy::kBudget, DensityStrategy::kAdc, DensityStrategy::kMcmc}) {
    TrainOptions options = short_training(60);
    options.strategy = strategy;
    options.exposure = strategy == DensityStrategy::kBudget;
    options.poses = strategy == DensityStrategy::kAdc;
    options.trace.deterministic = true;
    options.max_gaussians = 900;
    const std::string name = std::to_string(static_cast<int>(strategy));
    Trainer plain(shared_test_context(), load_dataset(data), options,
                  folder.path() / ("plain" + name));
    plain.run(false);
    Trainer estimated(shared_test_context(), load_dataset(data), options,
                      folder.path() / ("estimated" + name));
    const RunEstimate estimate = estimated.estimate(0.3);
    CHECK(estimate.iterations == 60);
    CHECK(estimate.seconds > 0);
    CHECK(estimated.iteration() == 0);
    const TrainSummary summary = estimated.run(false);
    CHECK(estimate.evaluations == summary.evaluations.size());
    CHECK(estimate.evaluated_views == summary.evaluations.size());  // of one view
    CHECK(summary.gaussians <= estimate.gaussians);
    check_equal(plain.model(), estimated.model());
    CHECK_THROWS_AS(estimated.estimate(0.3), UsageError);
    CHECK_THROWS_AS(estimated.fit_time(10), UsageError);
  }
}

TEST_CASE("an estimate looks at the photos that the run's background comes from") {
  const TemporaryDirectory folder;
  const fs::path data = folder.path() / "data";
  // More photos than the background is the mean of, all of which the start looks at.
  make_photos(data, 16, 40, 1, SyntheticScene::kOutdoor);
  TrainOptions options = short_training(2);
  options.init = "photos";
  options.trace.deterministic = true;
  const auto background = [&](const std::string& name) {
    TrainOptions used;
    read_train_config(folder.path() / name / "config.toml", used);
    return used.background;
  };
  for (const std::string name : {"auto", "sky", "exposure"}) {
    CAPTURE(name);
    options.background = name == "sky" ? "sky" : "auto";
    options.exposure = name == "exposure";
    Trainer plain(shared_test_context(), load_dataset(data), options,
                  folder.path() / ("plain " + name));
    plain.run(false);
    Trainer estimated(shared_test_context(), load_dataset(data), options,
                      folder.path() / ("estimated " + name));
    estimated.estimate(0.1);
    estimated.run(false);
    CHECK(background("plain " + name) == background("estimated " + name));
    check_equal(plain.model(), estimated.model());
  }
}

TEST_CASE("a run by time names its length, and a replay of its configuration gives its bytes") {
  const TemporaryDirectory folder;
  const fs::path data = folder.path() / "data", run = folder.path() / "run";
  make_photos(data, 48, 8, 1);
  TrainOptions options = short_training(10000);
  options.trace.deterministic = true;
  Trainer trainer(shared_test_context(), load_dataset(data), options, run);
  CHECK_THROWS_AS(trainer.fit_time(0), UsageError);
  for (const double endless : {HUGE_VAL, 1e300, std::nan("")}) {
    CHECK_THROWS_AS(trainer.fit_time(endless), UsageError);
    CHECK_THROWS_AS(trainer.estimate(endless), UsageError);
  }
  CHECK_THROWS_AS(trainer.fit_time(1e-4), UsageError);
  const RunEstimate estimate = trainer.fit_time(4);
  CHECK(estimate.seconds <= 4.0);
  const TrainSummary summary = trainer.run(false);
  CHECK(summary.iterations <= 2 * estimate.iterations);
  MESSAGE("4 s asked, " << summary.training_seconds << " s taken, " << summary.iterations
                        << " iterations, " << summary.gaussians << " Gaussians");
  // Far looser than what a device that nobody else uses keeps to.
  CHECK(summary.training_seconds > 1.0);
  CHECK(summary.training_seconds < 16.0);

  TrainOptions replayed;
  read_train_config(run / "config.toml", replayed);
  CHECK(replayed.iterations == estimate.iterations);
  CHECK(replayed.end_iteration == summary.iterations);  // once the last steps were timed
  CHECK(replayed.max_gaussians == static_cast<std::int64_t>(estimate.gaussians));
  CHECK_FALSE(replayed.photo_points);  // which would take a part of so short a time
  CHECK(replayed.uncovered_points);
  Trainer again(shared_test_context(), load_dataset(data), replayed, folder.path() / "again");
  again.run(false);
  check_equal(trainer.model(), again.model());
}

TEST_CASE("a run by time whose limit is given keeps the first model that was measured") {
  const TemporaryDirectory folder;
  const fs::path data = folder.path() / "data";
  make_photos(data, 48, 8, 1);
  TrainOptions options = short_training(10000);
  options.trace.deterministic = true;
  options.max_gaussians = 400;
  Trainer trainer(shared_test_context(), load_dataset(data), options, folder.path() / "run");
  trainer.fit_time(4);
  trainer.step(2);
  trainer.save();
  TrainOptions replayed;
  read_train_config(folder.path() / "run" / "config.toml", replayed);
  Trainer again(shared_test_context(), load_dataset(data), replayed, folder.path() / "again");
  again.step(2);
  check_equal(trainer.model(), again.model());
}

TEST_CASE("a run by time of few iterations sees small photos for longer, unless told otherwise") {
  const TemporaryDirectory folder;
  const fs::path data = folder.path() / "data";
  make_photos(data, 256, 8, 1);
  const auto planned = [&](const TrainOptions& options, const std::string& name) {
    Trainer trainer(shared_test_context(), load_dataset(data), options, folder.path() / name);
    trainer.fit_time(4);
    trainer.step();
    trainer.save();
    TrainOptions used;
    read_train_config(folder.path() / name / "config.toml", used);
    return used;
  };
  TrainOptions options;
  const TrainOptions chosen = planned(options, "chosen");
  // On a device that makes many iterations in this time nothing is to be chosen.
  const bool kept = chosen.resolution_schedule == options.resolution_schedule;
  CHECK((kept ? chosen.iterations >= 500 : chosen.resolution_schedule.back().until.value == 0.9));
  options.resolution_schedule = {{2, 0.3}};
  CHECK(planned(options, "given").resolution_schedule == options.resolution_schedule);
}

TEST_CASE("a run ends where it is told to, with the schedules of its iterations") {
  const TemporaryDirectory folder;
  const fs::path data = folder.path() / "data";
  make_photos(data, 32, 8, 1);
  TrainOptions options = short_training(60);
  options.trace.deterministic = true;
  options.average_from = 0;  // else each ends with the mean of its own last steps
  Trainer whole(shared_test_context(), load_dataset(data), options, folder.path() / "whole");
  for (const std::int64_t end : {50, 60}) {
    CAPTURE(end);
    options.end_iteration = end;
    Trainer early(shared_test_context(), load_dataset(data), options,
                  folder.path() / ("end" + std::to_string(end)));
    CHECK(early.run(false).iterations == end);
    CHECK_FALSE(early.step());
    CHECK(early.iteration() == end);
    whole.step(end - whole.iteration());
    check_equal(early.model(), whole.model());
  }
  options.end_iteration = 70;
  Trainer late(shared_test_context(), load_dataset(data), options, folder.path() / "late");
  CHECK(late.run(false).iterations == 70);
  options.end_iteration = 0;
  options.iterations = 60;
  Trainer shorter(shared_test_context(), load_dataset(data), options, folder.path() / "late", true);
  CHECK_THROWS_AS(shorter.resume(folder.path() / "late"), UsageError);
}

TEST_CASE("a long run of few photos is told how long they ask for") {
  const TemporaryDirectory folder;
  const fs::path data = folder.path() / "data";
  make_photos(data, 16, 8, 1);
  for (const int iterations : {2000, 2001}) {
    CAPTURE(iterations);
    TrainOptions options = short_training(iterations);
    const LogCapture log;
    Trainer trainer(shared_test_context(), load_dataset(data), options,
                    folder.path() / std::to_string(iterations));
    trainer.step();
    CHECK(log.contains("without -n and --time a run has 1000") == (iterations > 2000));
  }
}
