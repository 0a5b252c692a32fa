// SPDX-License-Identifier: Apache-2.0
// What runs may learn from: training photos, and validation photos once they have judged.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <csignal>
#include <filesystem>
#include <fstream>
#include <glm/geometric.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "raysplats/dataset.hpp"
#include "raysplats/device.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "raysplats/trainer.hpp"
#include "train/schedule.hpp"
#include "unit/fixture.hpp"
#include "unit/log_capture.hpp"
#include "unit/train/short_training.hpp"
#include "util/rng.hpp"

using namespace raysplats;
namespace fs = std::filesystem;

namespace {

constexpr int kSize = 32;
constexpr int kTrainViews = 8;

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

// The photos over grey, and of those for validation cameras that are turned too far, by so many
// radians, and colours times `gain`.
Dataset with_wrong_validation(const fs::path& data,
                              const fs::path& photos,
                              double turn,
                              float gain) {
  Dataset out = load_dataset(data);
  out.alpha_is_background = false;
  const float grey[3] = {0.4f, 0.45f, 0.5f};
  const std::vector<std::size_t> train = out.indices(Split::kTrain);
  std::vector<std::size_t> judges;
  for (const std::size_t i : validation_views(train.size(), 2)) judges.push_back(train[i]);
  for (std::size_t i = 0; i < out.views.size(); ++i) {
    View& view = out.views[i];
    Image photo = composite(load_view_image(view), grey);
    if (std::find(judges.begin(), judges.end(), i) != judges.end()) {
      for (float& value : photo.data) value *= gain;
      view.camera = moved(view.camera, {0.0, turn, 0.0}, {0.0, 0.0, 0.0});
    }
    view.image_path = photos / (std::to_string(i) + ".png");
    write_image(view.image_path, photo);
  }
  return out;
}

}  // namespace

TEST_CASE("test photos influence no run: with noise in their place it gives the same model") {
  const TemporaryDirectory folder;
  const fs::path data = folder.path() / "data";
  make_photos(data, kSize, kTrainViews, 2);
  const auto trained = [&](const std::string& name) {
    TrainOptions options = options_of(60, 2);
    options.eval_at = {0.5};
    Trainer trainer(shared_test_context(), load_dataset(data), options, folder.path() / name);
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
    Trainer trainer(shared_test_context(), load_dataset(data), options_of(40, 2),
                    folder.path() / name);
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

TEST_CASE("a signal breaks off a validation, which the resumed run makes up for") {
  const TemporaryDirectory folder;
  const fs::path data = folder.path() / "data", straight = folder.path() / "straight",
                 broken = folder.path() / "broken";
  make_photos(data, kSize, kTrainViews, 1);
  TrainOptions options = options_of(60, 2);
  options.poses = true;  // each view is moved to where it fits
  options.exposure = true;
  Trainer whole(shared_test_context(), load_dataset(data), options, straight);
  whole.run(false);
  {
    Trainer part(shared_test_context(), load_dataset(data), options, broken);
    part.on_step([&](const TrainProgress& progress) {
      if (progress.iteration == 12) std::raise(SIGTERM);
    });
    CHECK_THROWS_AS(part.run(false), Error);
  }
  REQUIRE(validates_at(options, 12));
  CHECK(metrics_of(broken).at("validations").size() == 1);
  Trainer rest(shared_test_context(), load_dataset(data), options, broken);
  rest.resume("latest");
  CHECK(rest.iteration() == 12);
  rest.run(false);
  const auto psnr = [](const fs::path& run) {
    const nlohmann::json rows = metrics_of(run).at("validations");
    std::vector<double> out;
    for (const nlohmann::json& row : rows) out.push_back(row.at("psnr").get<double>());
    return out;
  };
  CHECK(psnr(broken).size() == 9);
  CHECK(psnr(broken) == psnr(straight));
  check_equal(rest.model(), whole.model(), true);
}

TEST_CASE("with poses validation photos influence nothing to the end, and their poses stay") {
  const TemporaryDirectory folder;
  const fs::path data = folder.path() / "data";
  make_photos(data, kSize, kTrainViews, 1);
  const Dataset dataset = load_dataset(data);
  const std::vector<std::size_t> train = dataset.indices(Split::kTrain);
  std::vector<std::size_t> judges;
  for (const std::size_t i : validation_views(train.size(), 2)) judges.push_back(train[i]);
  TrainOptions options = options_of(40, 2);
  options.poses = true;

  // Interrupted where other runs train on all views, with the same end.
  Trainer broken(shared_test_context(), load_dataset(data), options, folder.path() / "broken");
  broken.step(38);
  broken.save();
  std::vector<Gaussians> models;
  for (const char* name : {"clean", "rest", "noise"}) {
    const fs::path run = folder.path() / name;
    Trainer trainer(shared_test_context(), load_dataset(data), options, run);
    if (name == std::string("rest")) trainer.resume(folder.path() / "broken");
    trainer.run(false);
    models.push_back(trainer.model());
    // Photos that no step has seen are not among those that the run says something of.
    if (name != std::string("rest")) CHECK(metrics_of(run).at("photos").size() == kTrainViews - 2);
    if (name == std::string("rest"))
      for (const std::size_t i : judges) make_noise_of(dataset.views[i].image_path);
  }
  check_equal(models[0], models[1], true);
  check_equal(models[0], models[2], true);

  const std::vector<Camera> refined = read_cameras(folder.path() / "clean/cameras_refined.json");
  REQUIRE(refined.size() == train.size());
  for (std::size_t i = 0; i < refined.size(); ++i) {
    CAPTURE(i);
    const bool judge = std::find(judges.begin(), judges.end(), train[i]) != judges.end();
    const Camera& given = dataset.views[train[i]].camera;
    CHECK((glm::distance(refined[i].center(), given.center()) < 1e-9) == judge);
  }

  // A longer run goes on to be judged by them.
  options.iterations = 80;
  Trainer longer(shared_test_context(), load_dataset(data), options, folder.path() / "noise");
  const LogCapture log;
  longer.resume("latest");
  CHECK_FALSE(log.contains("stay in the loss"));
  longer.run(false);
  CHECK(metrics_of(folder.path() / "noise").at("validations").back().at("iteration") == 72);
}

TEST_CASE("validation is recorded, resumed runs end with the same bytes, the best model is kept") {
  const TemporaryDirectory folder;
  const fs::path data = folder.path() / "data", straight = folder.path() / "straight",
                 broken = folder.path() / "broken";
  make_photos(data, kSize, kTrainViews, 1);
  TrainOptions options = options_of(100, 2);
  Trainer whole(shared_test_context(), load_dataset(data), options, straight);
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
  Trainer(shared_test_context(), load_dataset(data), options, broken).run(false);
  fs::remove(broken / "checkpoints/step_000000100.rsck");
  fs::remove(broken / "checkpoints/step_000000090.rsck");
  Trainer resumed(shared_test_context(), load_dataset(data), options, broken);
  resumed.resume("latest");
  CHECK(resumed.iteration() == 45);
  resumed.run(false);
  check_equal(whole.model(), resumed.model(), true);
  const nlohmann::json again = metrics_of(broken).at("validations");
  REQUIRE(again.size() == 9);
  for (std::size_t i = 0; i < 9; ++i) CHECK(again[i].at("psnr") == rows[i].at("psnr"));

  TrainOptions other = options;
  other.validate_views = 3;
  Trainer misfit(shared_test_context(), load_dataset(data), other, broken);
  CHECK_THROWS_AS(misfit.resume("latest"), UsageError);
}

TEST_CASE(
    "neither poses nor exposures of validation photos count where those of others are found") {
  const TemporaryDirectory folder;
  const fs::path data = folder.path() / "data";
  make_photos(data, 24, kTrainViews, 1);
  struct Kind {
    bool poses, exposure;
    const char* name;
  };
  for (const Kind& kind : {Kind{true, false, "poses"}, Kind{false, true, "exposure"},
                           Kind{true, true, "poses and exposure"}}) {
    CAPTURE(kind.name);
    const double turn = kind.poses ? 0.05 : 0.0;  // nearly two pixels
    const float gain = kind.exposure ? 0.6f : 1.0f;
    std::vector<double> psnr;
    for (const bool wrong : {false, true}) {
      const fs::path run = folder.path() / kind.name / (wrong ? "wrong" : "right");
      const Dataset dataset =
          with_wrong_validation(data, run / "photos", wrong ? turn : 0.0, wrong ? gain : 1.0f);
      TrainOptions options = options_of(40, 2);
      options.poses = kind.poses;
      options.exposure = kind.exposure;
      Trainer(shared_test_context(), dataset, options, run / "run").run(false);
      psnr.push_back(metrics_of(run / "run").at("validations").back().at("psnr"));
    }
    // Darker photos have smaller errors. As they are, they would lose 4 dB by the turn and 9 by
    // the gain.
    const double expected = psnr[0] - 20 * std::log10(static_cast<double>(gain));
    MESSAGE(kind.name << ": " << psnr[0] << " dB, with wrong validation photos " << psnr[1]);
    CHECK(std::abs(psnr[1] - expected) < 1.5);
  }
}

TEST_CASE("validation views that were trained on stay in the loss of a longer run and judge none") {
  const TemporaryDirectory folder;
  const fs::path data = folder.path() / "data", run = folder.path() / "run";
  make_photos(data, kSize, kTrainViews, 1);
  TrainOptions options = options_of(40, 2);
  Trainer first(shared_test_context(), load_dataset(data), options, run);
  first.run(false);
  const std::string warning = "stay in the loss and judge no more";
  const auto resumed = [&](const char* name, const fs::path& source, bool warned) {
    auto trainer = std::make_unique<Trainer>(shared_test_context(), load_dataset(data), options,
                                             folder.path() / name);
    const LogCapture log;
    trainer->resume(source);
    CHECK(log.contains(warning) == warned);
    return trainer;
  };

  // As long as it was to be, a run goes on as if it had not been interrupted.
  Trainer broken(shared_test_context(), load_dataset(data), options, folder.path() / "broken");
  broken.step(38);
  broken.save();
  const auto rest = resumed("rest", folder.path() / "broken", false);
  rest->run(false);
  check_equal(first.model(), rest->model(), true);

  options.iterations = 80;
  const auto whole = resumed("whole", run, true);
  whole->run(false);
  CHECK_FALSE(metrics_of(folder.path() / "whole").contains("validations"));
  // Wherever it is interrupted.
  const auto part = resumed("part", run, true);
  part->step(15);  // the rest of a pass over all views, and a whole one
  part->save();
  CHECK(metrics_of(folder.path() / "part").at("photos").size() == kTrainViews);
  const auto end = resumed("end", folder.path() / "part", true);
  end->run(false);
  check_equal(whole->model(), end->model(), true);

  // In the same folder the judgements of the shorter run remain.
  const nlohmann::json before = metrics_of(run).at("validations");
  Trainer longer(shared_test_context(), load_dataset(data), options, run);
  longer.resume("latest");
  longer.run(false);
  CHECK(metrics_of(run).at("validations") == before);
  check_equal(whole->model(), longer.model(), true);
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
  Trainer trainer(shared_test_context(), load_dataset(data), options, run);
  const TrainSummary summary = trainer.run(false);
  CHECK(summary.iterations == 30);
  CHECK(metrics_of(run).at("complete") == true);
  CHECK(metrics_of(run).at("evaluations").back().at("iteration") == 30);
  CHECK(fs::exists(run / "point_cloud/iteration_30/point_cloud.ply"));
  CHECK(fs::exists(run / "checkpoints/step_000000030.rsck"));

  // It stays over when it is resumed, until it is given more patience.
  for (const auto& [patience, end] : {std::pair{2, 30}, std::pair{3, 40}}) {
    options.patience = patience;
    Trainer resumed(shared_test_context(), load_dataset(data), options, run);
    resumed.resume("latest");
    CHECK(resumed.run(false).iterations == end);
    CHECK(metrics_of(run).at("complete") == true);
    CHECK(metrics_of(run).at("evaluations").back().at("iteration") == end);
  }
}

TEST_CASE("validation needs views, and patience validation") {
  const TemporaryDirectory folder;
  const fs::path data = folder.path() / "data";
  make_photos(data, kSize, 4, 1);
  CHECK_THROWS_AS(
      Trainer(shared_test_context(), load_dataset(data), options_of(10, 3), folder.path() / "run"),
      UsageError);
  TrainOptions options = options_of(10, 0);
  options.patience = 1;
  CHECK_THROWS_AS(
      Trainer(shared_test_context(), load_dataset(data), options, folder.path() / "run"),
      UsageError);
}
