// SPDX-License-Identifier: Apache-2.0
// Whole runs of the mcmc strategy, and of runs in a box.
#include <doctest/doctest.h>

#include <filesystem>
#include <string>

#include "raysplats/dataset.hpp"
#include "raysplats/device.hpp"
#include "raysplats/error.hpp"
#include "raysplats/evaluation.hpp"
#include "raysplats/io.hpp"
#include "raysplats/model.hpp"
#include "raysplats/tracer.hpp"
#include "raysplats/trainer.hpp"
#include "unit/fixture.hpp"
#include "unit/train/short_training.hpp"

using namespace raysplats;
namespace fs = std::filesystem;

namespace {

TrainOptions mcmc_options() {
  TrainOptions options = short_training(400);
  options.strategy = DensityStrategy::kMcmc;
  options.max_gaussians = 1500;
  options.trace.deterministic = true;
  return options;
}

}  // namespace

TEST_CASE("the mcmc strategy learns, grows to its limit and resumes exactly") {
  const TemporaryDirectory folder;
  const fs::path data = folder.path() / "data", broken = folder.path() / "broken";
  make_photos(data, 40, 12, 3);
  TrainOptions options = mcmc_options();
  Trainer straight(shared_test_context(), load_dataset(data), options, folder.path() / "straight");
  const TrainSummary mcmc = straight.run(false);
  CHECK(mcmc.gaussians > 1400);
  CHECK(mcmc.gaussians <= 1500);

  TrainOptions budget = options;
  budget.strategy = DensityStrategy::kBudget;
  Trainer other(shared_test_context(), load_dataset(data), budget, folder.path() / "budget");
  const TrainSummary plain = other.run(false);
  MESSAGE("mcmc " << mcmc.evaluations.back().psnr << " dB, budget " << plain.evaluations.back().psnr
                  << " dB");
  // Measured: 27.1 and 28.4 dB.
  CHECK(mcmc.evaluations.back().psnr > plain.evaluations.back().psnr - 1.75);

  options.checkpoint_every = 170;  // between two passes
  options.keep_checkpoints = 9;
  Trainer(shared_test_context(), load_dataset(data), options, broken).run(false);
  for (const char* later : {"340", "400"})
    fs::remove(broken / "checkpoints" / ("step_000000" + std::string(later) + ".rsck"));
  Trainer resumed(shared_test_context(), load_dataset(data), options, broken);
  resumed.resume("latest");
  CHECK(resumed.iteration() == 170);
  resumed.run(false);
  check_equal(straight.model(), resumed.model());
}

TEST_CASE("a run in a box starts, grows and ends in it") {
  const TemporaryDirectory folder;
  const fs::path data = folder.path() / "data";
  make_photos(data, 40, 8, 1);
  for (const DensityStrategy strategy :
       {DensityStrategy::kBudget, DensityStrategy::kAdc, DensityStrategy::kMcmc}) {
    CAPTURE(static_cast<int>(strategy));
    TrainOptions options = mcmc_options();
    options.iterations = 150;
    options.strategy = strategy;
    options.bounds = Bounds{{-0.4, -0.3, -2}, {0.4, 0.5, 2}};
    const fs::path run = folder.path() / std::to_string(static_cast<int>(strategy));
    Trainer trainer(shared_test_context(), load_dataset(data), options, run);
    const EvaluationRow row = trainer.run(false).evaluations.back();
    const fs::path ply = run / "point_cloud/iteration_150/point_cloud.ply";
    const Gaussians model = read_ply(ply);
    REQUIRE(model.size() > 20);
    std::size_t outside = 0;
    for (std::size_t i = 0; i < model.size(); ++i) {
      const float* m = model.means.data() + 3 * i;
      outside += options.bounds->contains(m[0], m[1], m[2]) ? 0 : 1;
    }
    CHECK(outside == 0);
    // What was measured is what was saved.
    CHECK(row.gaussians == model.size());
    const TraceOptions trace = read_ply_options(ply).value();
    Tracer tracer(shared_test_context(), trace);
    const Model saved(shared_test_context(), model);
    const EvaluationReport report =
        evaluate([&](const Camera& camera) { return tracer.render(saved, camera); },
                 load_dataset(data), Split::kTest, trace.background);
    CHECK(row.psnr == doctest::Approx(report.mean.psnr).epsilon(1e-5));
    // Passes have kept the model in the box, not only what was saved.
    CHECK(trainer.model().size() < 2 * model.size());
  }
  TrainOptions options = mcmc_options();
  options.bounds = Bounds{{90, 90, 90}, {91, 91, 91}};
  Trainer nowhere(shared_test_context(), load_dataset(data), options, folder.path() / "nowhere");
  CHECK_THROWS_AS(nowhere.run(false), UsageError);
}
