// SPDX-License-Identifier: Apache-2.0
// What runs may learn from: training photos, and validation photos once they have judged.
#include <doctest/doctest.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "raysplats/context.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/device.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "raysplats/trainer.hpp"
#include "train/schedule.hpp"
#include "unit/fixture.hpp"
#include "unit/train/short_training.hpp"
#include "util/rng.hpp"

using namespace raysplats;
namespace fs = std::filesystem;

namespace {

constexpr int kSize = 32;
constexpr int kTrainViews = 8;

Context& context() {
  static Context instance(test_device());
  return instance;
}

void make_noise_of(const fs::path& photo) {
  Image image = read_image(photo);
  CounterRng rng(3, 1);
  for (float& v : image.data) v = static_cast<float>(rng.uniform());
  write_image(photo, image);
}

TrainOptions options_of(int iterations, int validation) {
  TrainOptions options = short_training(iterations);
  options.validate_views = validation;
  options.max_gaussians = 800;
  options.trace.deterministic = true;
  return options;
}

void check_equal(const Gaussians& a, const Gaussians& b, bool equal) {
  CHECK((a.means == b.means) == equal);
  CHECK((a.sh == b.sh) == equal);
}

nlohmann::json metrics_of(const fs::path& run) {
  return nlohmann::json::parse(std::ifstream(run / "metrics.json"));
}

}  // namespace

TEST_CASE("test photos influence no run: with noise in their place it gives the same model") {
  const TemporaryDirectory folder;
  const fs::path data = folder.path() / "data";
  make_photos(data, kSize, kTrainViews, 2);
  const auto trained = [&](const std::string& name) {
    TrainOptions options = options_of(60, 2);
    options.eval_at = {0.5};
    Trainer trainer(context(), load_dataset(data), options, folder.path() / name);
    const double psnr = trainer.run(false).evaluations.back().psnr;
    return std::pair(trainer.model(), psnr);
  };
  const auto [before, psnr] = trained("before");
  for (int i = 0; i < 2; ++i) make_noise_of(data / "test" / ("r_" + std::to_string(i) + ".png"));
  const auto [after, noise_psnr] = trained("after");
  CHECK(noise_psnr < psnr - 3);  // they were looked at
  check_equal(before, after, true);
}

TEST_CASE("validation photos influence nothing until nine tenths of the run, then they do") {
  const TemporaryDirectory folder;
  const fs::path data = folder.path() / "data";
  make_photos(data, kSize, kTrainViews, 1);
  std::vector<Gaussians> early, late;
  for (const char* name : {"clean", "noise"}) {
    Trainer trainer(context(), load_dataset(data), options_of(40, 2), folder.path() / name);
    trainer.step(36);
    early.push_back(trainer.model());
    trainer.step(4);
    late.push_back(trainer.model());
    const Dataset dataset = load_dataset(data);
    const std::vector<std::size_t> train = dataset.indices(Split::kTrain);
    for (const std::size_t i : validation_views(train.size(), 2))
      make_noise_of(dataset.views[train[i]].image_path);
  }
  check_equal(early[0], early[1], true);
  check_equal(late[0], late[1], false);
}

TEST_CASE("validation is recorded, resumed runs end with the same bytes, the best model is kept") {
  const TemporaryDirectory folder;
  const fs::path data = folder.path() / "data", straight = folder.path() / "straight",
                 broken = folder.path() / "broken";
  make_photos(data, kSize, kTrainViews, 1);
  TrainOptions options = options_of(100, 2);
  Trainer whole(context(), load_dataset(data), options, straight);
  whole.run(false);
  const nlohmann::json rows = metrics_of(straight).at("validations");
  REQUIRE(rows.size() == 9);
  std::size_t best = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    CHECK(rows[i].at("iteration") == 10 * (i + 1));
    CHECK(rows[i].at("views") == 2);
    if (rows[i].at("psnr") > rows[best].at("psnr")) best = i;
  }
  const bool fell = rows[best].at("psnr") > rows.back().at("psnr").get<double>() + 0.1;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const fs::path model = straight / "point_cloud" / ("iteration_" + std::to_string(10 * (i + 1)));
    CHECK(fs::exists(model) == (fell && i == best));
  }

  options.checkpoint_every = 45;
  options.keep_checkpoints = 9;
  Trainer(context(), load_dataset(data), options, broken).run(false);
  fs::remove(broken / "checkpoints/step_000000100.rsck");
  fs::remove(broken / "checkpoints/step_000000090.rsck");
  Trainer resumed(context(), load_dataset(data), options, broken);
  resumed.resume("latest");
  CHECK(resumed.iteration() == 45);
  resumed.run(false);
  check_equal(whole.model(), resumed.model(), true);
  const nlohmann::json again = metrics_of(broken).at("validations");
  REQUIRE(again.size() == 9);
  for (std::size_t i = 0; i < 9; ++i) CHECK(again[i].at("psnr") == rows[i].at("psnr"));

  TrainOptions other = options;
  other.validate_views = 3;
  Trainer misfit(context(), load_dataset(data), other, broken);
  CHECK_THROWS_AS(misfit.resume("latest"), UsageError);
}

TEST_CASE("a run that no longer gains ends when its patience does, with its results in place") {
  const TemporaryDirectory folder;
  const fs::path data = folder.path() / "data", run = folder.path() / "run";
  make_photos(data, kSize, kTrainViews, 1);
  TrainOptions options = options_of(100, 1);
  options.patience = 2;
  // Nothing moves: the first validation stays the best.
  for (LearningRate* rate : {&options.position_lr, &options.rotation_lr, &options.scale_lr,
                             &options.opacity_lr, &options.sh_lr, &options.sh_rest_lr})
    *rate = {0, 0};
  options.densify_until = 0;
  options.footprint = 0;
  Trainer trainer(context(), load_dataset(data), options, run);
  const TrainSummary summary = trainer.run(false);
  CHECK(summary.iterations == 30);
  CHECK(metrics_of(run).at("complete") == true);
  CHECK(metrics_of(run).at("evaluations").back().at("iteration") == 30);
  CHECK(fs::exists(run / "point_cloud/iteration_30/point_cloud.ply"));
  CHECK(fs::exists(run / "checkpoints/step_000000030.rsck"));
}

TEST_CASE("validation needs views, and patience validation") {
  const TemporaryDirectory folder;
  const fs::path data = folder.path() / "data";
  make_photos(data, kSize, 4, 1);
  CHECK_THROWS_AS(Trainer(context(), load_dataset(data), options_of(10, 3), folder.path() / "run"),
                  UsageError);
  TrainOptions options = options_of(10, 0);
  options.patience = 1;
  CHECK_THROWS_AS(Trainer(context(), load_dataset(data), options, folder.path() / "run"),
                  UsageError);
}
