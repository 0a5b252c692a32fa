// SPDX-License-Identifier: Apache-2.0
// Runs that were broken off, refused or over, and what they are when they go on.
#include <doctest/doctest.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>
#include <vector>

#include "raysplats/dataset.hpp"
#include "raysplats/error.hpp"
#include "raysplats/trainer.hpp"
#include "run/checkpoint.hpp"
#include "run/train_config.hpp"
#include "trace/device_gaussians.hpp"
#include "unit/fixture.hpp"
#include "unit/log_capture.hpp"
#include "unit/text.hpp"
#include "unit/train/depth_file.hpp"
#include "unit/train/short_training.hpp"
#include "util/atomic_file.hpp"

using namespace raysplats;
using test::contains;
using test::message_of;
namespace fs = std::filesystem;

namespace {

constexpr int kIterations = 40;
constexpr std::int64_t kTooMany = 2'000'000'000;  // Gaussians, for any device

// Forty iterations with density control after each tenth up to the thirtieth, and a checkpoint
// after each twentieth.
TrainOptions growing() {
  TrainOptions options = short_training(kIterations);
  options.init = "random";
  options.init_count = 200;
  options.max_gaussians = 400;
  options.sh_degree = 1;
  options.densify_from = 10;
  options.densify_every = 10;
  options.densify_until = 30;
  options.resolution_schedule = {};
  options.checkpoint_every = 20;
  options.keep_checkpoints = 9;
  options.log_every = 2;
  options.trace.deterministic = true;
  options.trace.memory_budget = std::size_t{64} << 20;
  return options;
}

// Photos, and folders of runs on them.
struct Place {
  TemporaryDirectory folder;

  Place() { make_photos(folder / "data", 24, 5, 2); }
  fs::path run(const char* name) const { return folder / name; }
  std::unique_ptr<Trainer> trainer(const TrainOptions& options,
                                   const char* name,
                                   bool overwrite = false) const {
    return std::make_unique<Trainer>(shared_test_context(), load_dataset(folder / "data"), options,
                                     run(name), overwrite);
  }
  std::unique_ptr<Trainer> resumed(const TrainOptions& options, const char* name) const {
    auto out = trainer(options, name);
    out->resume("latest");
    return out;
  }
  // The message with which a run ends; its evaluation of that iteration cannot be written.
  std::string broken(const TrainOptions& options, const char* name, int iteration) const {
    const fs::path way = blocked(name, iteration);
    write_text_file(way, "in the way");
    const std::string message = message_of<DataError>([&] { trainer(options, name)->run(false); });
    fs::remove(way);
    return message;
  }
  fs::path blocked(const char* name, int iteration) const {
    return run(name) / "eval" / ("iteration_" + std::to_string(iteration));
  }
  fs::path model(const char* name, int iteration) const {
    return run(name) / "point_cloud" / ("iteration_" + std::to_string(iteration)) /
           "point_cloud.ply";
  }
  nlohmann::json metrics(const char* name) const {
    return nlohmann::json::parse(std::ifstream(run(name) / "metrics.json"));
  }
};

}  // namespace

TEST_CASE("a run that broke off in an evaluation goes on as if it had not") {
  const Place place;
  TrainOptions options = growing();
  options.eval_at = {20, 25};
  const auto straight = place.trainer(options, "straight");
  const TrainSummary whole = straight->run(false);
  REQUIRE(whole.evaluations.size() == 3);
  REQUIRE(whole.gaussians != 200);
  // Density control is due after the first of them, after the second not.
  for (const int iteration : {20, 25}) {
    CAPTURE(iteration);
    const std::string name = "broken" + std::to_string(iteration);
    const std::string message = place.broken(options, name.c_str(), iteration);
    CHECK(contains(message, "iteration " + std::to_string(iteration) + " is saved"));
    CHECK(load_latest_checkpoint(place.run(name.c_str())).pass_due == (iteration == 20));
    CHECK(place.metrics(name.c_str()).at("iteration") == iteration);
    const auto resumed = place.resumed(options, name.c_str());
    const TrainSummary summary = resumed->run(false);
    check_equal(straight->gaussians().download(), resumed->gaussians().download());
    CHECK(load_latest_checkpoint(place.run(name.c_str())).sections ==
          load_latest_checkpoint(place.run("straight")).sections);
    // The evaluation is made up for, of the same model.
    REQUIRE(summary.evaluations.size() == 3);
    for (std::size_t i = 0; i < 3; ++i) {
      CHECK(summary.evaluations[i].iteration == whole.evaluations[i].iteration);
      CHECK(summary.evaluations[i].psnr == whole.evaluations[i].psnr);
    }
  }
}

TEST_CASE("a run that is stopped where it evaluates and density control is due goes on with both") {
  const Place place;
  TrainOptions options = growing();
  options.eval_at = {20};
  const auto straight = place.trainer(options, "straight");
  const TrainSummary whole = straight->run(false);
  const auto first = place.trainer(options, "run");
  first->on_step([&](const TrainProgress& progress) {
    if (progress.iteration == 20) first->stop();
  });
  CHECK(first->run(false).evaluations.empty());
  CHECK(load_latest_checkpoint(place.run("run")).pass_due);
  const auto resumed = place.resumed(options, "run");
  const TrainSummary summary = resumed->run(false);
  check_equal(straight->gaussians().download(), resumed->gaussians().download());
  CHECK(load_latest_checkpoint(place.run("run")).sections ==
        load_latest_checkpoint(place.run("straight")).sections);
  REQUIRE(whole.evaluations.size() == 2);
  REQUIRE(summary.evaluations.size() == 2);
  for (std::size_t i = 0; i < 2; ++i) {
    CHECK(summary.evaluations[i].iteration == whole.evaluations[i].iteration);
    CHECK(summary.evaluations[i].psnr == whole.evaluations[i].psnr);
  }
}

TEST_CASE("a run whose density control counted less goes on as it would have") {
  const Place place;
  TrainOptions options = growing();
  options.prune_weight = 0;
  options.checkpoint_every = 25;  // between two passes
  const auto straight = place.trainer(options, "straight");
  straight->run(false);
  Checkpoint checkpoint = read_checkpoint(checkpoint_path(place.run("straight"), 25));
  std::vector<float>& density = checkpoint.sections.at("density");
  REQUIRE(density.size() == 3 * checkpoint.count);
  std::vector<float> older;
  for (std::size_t i = 0; i < density.size(); ++i) {
    if (i % 3 != 2) older.push_back(density[i]);
  }
  density = older;
  write_checkpoint(checkpoint_path(place.run("older"), 25), checkpoint);
  const auto resumed = place.resumed(options, "older");
  resumed->run(false);
  check_equal(straight->gaussians().download(), resumed->gaussians().download());

  density.pop_back();
  write_checkpoint(checkpoint_path(place.run("damaged"), 25), checkpoint);
  CHECK(contains(message_of<DataError>([&] { place.resumed(options, "damaged"); }), "'density'"));
}

TEST_CASE("a run that was killed after a checkpoint knows what it had said of itself until then") {
  const Place place;
  TrainOptions options = growing();
  options.checkpoint_every = 38;
  place.trainer(options, "straight")->run(false);
  const auto first = place.trainer(options, "run");
  first->set_command("train first");
  first->on_step([&](const TrainProgress& progress) {
    if (progress.iteration == 39)
      fs::copy(place.run("run"), place.run("killed"), fs::copy_options::recursive);
  });
  first->run(false);
  // The rest of two steps sees some of the photos alone.
  const auto second = place.resumed(options, "killed");
  CHECK(second->iteration() == 38);
  second->set_command("train second");
  second->run(false);
  const nlohmann::json whole = place.metrics("straight"), parts = place.metrics("killed");
  CHECK(parts.at("command") == "train first");
  CHECK(parts.at("commands") == nlohmann::json{"train first", "train second"});
  REQUIRE(parts.at("photos").size() == 5);
  for (std::size_t i = 0; i < 5; ++i) {
    CHECK(parts.at("photos")[i].at("name") == whole.at("photos")[i].at("name"));
    CHECK(parts.at("photos")[i].at("psnr") == whole.at("photos")[i].at("psnr"));
  }
  CHECK(parts.at("timed_steps") == whole.at("timed_steps"));
}

TEST_CASE("steps of one's own after an error begin with the density control that it kept away") {
  const Place place;
  const TrainOptions options = growing();
  const auto straight = place.trainer(options, "straight");
  straight->step(kIterations);
  const auto disturbed = place.trainer(options, "disturbed");
  disturbed->on_step([](const TrainProgress& progress) {
    if (progress.iteration == 20) throw DataError("enough");
  });
  CHECK_THROWS_AS(disturbed->step(kIterations), DataError);
  disturbed->on_step(nullptr);
  disturbed->step(kIterations);
  check_equal(straight->gaussians().download(), disturbed->gaussians().download());
}

TEST_CASE("a final evaluation that failed comes when the run is resumed, and once") {
  const Place place;
  TrainOptions options = growing();
  options.eval_at = {20};
  const std::string message = place.broken(options, "run", kIterations);
  CHECK(contains(message, "iteration 40 is saved"));
  REQUIRE(fs::exists(place.model("run", kIterations)));
  const TrainSummary summary = place.resumed(options, "run")->run(false);
  REQUIRE(summary.evaluations.size() == 2);
  CHECK(summary.evaluations.back().iteration == kIterations);
  CHECK(place.metrics("run").at("complete") == true);

  fs::remove_all(place.blocked("run", kIterations));
  write_text_file(place.blocked("run", kIterations), "in the way");
  CHECK(place.resumed(options, "run")->run(false).evaluations.size() == 2);

  // One of a part of the views is not that of the end.
  options.eval_views = 1;
  place.trainer(options, "part")->run(false);
  fs::remove(checkpoint_path(place.run("part"), kIterations));
  fs::remove_all(place.run("part") / "point_cloud");
  options.iterations = 20;
  const TrainSummary shorter = place.resumed(options, "part")->run(false);
  REQUIRE(shorter.evaluations.size() == 1);
  CHECK(shorter.evaluations.back().views == 2);
}

TEST_CASE("a run that is refused for its memory removes nothing of the one that it would replace") {
  const Place place;
  TrainOptions options = growing();
  place.trainer(options, "run")->run(false);
  const std::string metrics = place.metrics("run").dump();
  options.max_gaussians = kTooMany;
  const auto refused = [&](Trainer& trainer) {
    return message_of<ResourceError>([&] { trainer.run(false); });
  };
  const auto fresh = place.trainer(options, "run", true);
  CHECK(contains(message_of<ResourceError>([&] { fresh->estimate(0.01); }), "--max-gaussians"));
  CHECK(contains(refused(*fresh), "--max-gaussians"));
  const auto resumed = place.trainer(options, "run", true);
  resumed->resume(checkpoint_path(place.run("run"), 20));
  CHECK(contains(refused(*resumed), "--max-gaussians"));
  CHECK(fs::exists(place.model("run", kIterations)));
  CHECK(fs::exists(checkpoint_path(place.run("run"), kIterations)));
  CHECK(place.metrics("run").dump() == metrics);

  // One that has room does replace it.
  options.max_gaussians = 400;
  options.iterations = 20;
  place.trainer(options, "run", true)->run(false);
  CHECK(!fs::exists(place.model("run", kIterations)));
}

TEST_CASE("a run of another length leaves no newer model of the one that it goes on from") {
  const Place place;
  TrainOptions options = growing();
  options.save_at = {28};
  place.trainer(options, "run")->run(false);
  // As if killed after iteration 28.
  fs::remove(checkpoint_path(place.run("run"), kIterations));
  fs::remove_all(place.model("run", kIterations).parent_path());
  const fs::path newer = place.model("run", 28);
  for (const int length : {24, 60}) {
    CAPTURE(length);
    options.iterations = length;
    options.save_at = {};
    const std::string message =
        message_of<UsageError>([&] { (void)place.resumed(options, "run"); });
    CHECK(contains(message, "a model of iteration 28"));
    CHECK(contains(message, "--overwrite"));
    CHECK(fs::exists(newer));
  }
  options.iterations = kIterations;
  CHECK(place.resumed(options, "run")->iteration() == 20);
  // Others that make that model again: by their length, or by when they save.
  options.iterations = 28;
  CHECK(place.resumed(options, "run")->iteration() == 20);
  options.iterations = 60;
  options.save_at = {28};
  CHECK(place.resumed(options, "run")->iteration() == 20);
  options.iterations = 24;
  options.save_at = {};
  const auto dropped = place.trainer(options, "run", true);
  dropped->resume("latest");
  dropped->run(false);
  CHECK(!fs::exists(newer));
  CHECK(fs::exists(place.model("run", 24)));

  // A folder without a checkpoint is begun anew, but not by a shorter run.
  fs::remove_all(place.run("run") / "checkpoints");
  options.iterations = 12;
  CHECK(contains(message_of<UsageError>([&] { (void)place.resumed(options, "run"); }),
                 "iteration 24"));
}

TEST_CASE("a run says the same of itself when it is resumed halfway and when it is over") {
  const Place place;
  const TrainOptions options = growing();
  place.trainer(options, "straight")->run(false);
  const nlohmann::json whole = place.metrics("straight");
  REQUIRE(whole.at("timed_steps") == 1);
  REQUIRE(whole.at("photos").size() == 5);

  const auto first = place.trainer(options, "run");
  first->set_command("train first");
  first->on_step([&](const TrainProgress& progress) {
    if (progress.iteration == 37) first->stop();
  });
  first->run(false);
  // The rest of three steps sees some of the photos alone.
  const auto second = place.resumed(options, "run");
  second->set_command("train second");
  second->run(false);
  const nlohmann::json parts = place.metrics("run");
  CHECK(parts.at("command") == "train first");
  CHECK(parts.at("loss") == whole.at("loss"));
  CHECK(parts.at("photos").size() == 5);
  for (std::size_t i = 0; i < 5; ++i) {
    CHECK(parts.at("photos")[i].at("name") == whole.at("photos")[i].at("name"));
    CHECK(parts.at("photos")[i].at("psnr") == whole.at("photos")[i].at("psnr"));
  }
  CHECK(parts.at("timed_steps") == 1);
  CHECK(parts.at("kernels").size() == whole.at("kernels").size());
  CHECK(parts.at("psnr_rise").get<double>() ==
        doctest::Approx(whole.at("psnr_rise").get<double>()).epsilon(1e-3));
  CHECK(parts.at("evaluation_seconds") > 0.0);

  // Nothing is left to do: nothing is said anew.
  for (int round = 0; round < 2; ++round) {
    const auto over = place.resumed(options, "run");
    over->set_command("train third");
    const TrainSummary summary = over->run(false);
    CHECK(summary.loss == doctest::Approx(parts.at("loss").get<double>()));
    CHECK(place.metrics("run") == parts);
  }
}

TEST_CASE("updates that were left out are counted over the whole run") {
  const Place place;
  const TrainOptions options = growing();
  place.trainer(options, "run")->run(false);
  fs::remove(checkpoint_path(place.run("run"), kIterations));
  Checkpoint half = load_latest_checkpoint(place.run("run"));
  REQUIRE(half.iteration == 20);
  CHECK(half.skipped_updates == 0);
  half.skipped_updates = 5;
  write_checkpoint(checkpoint_path(place.run("run"), 20), half);
  place.resumed(options, "run")->run(false);
  CHECK(place.metrics("run").at("skipped_updates") == 5);
  CHECK(load_latest_checkpoint(place.run("run")).skipped_updates == 5);
}

TEST_CASE("a run goes on with another weight of depths, or none, but not with other depth maps") {
  const Place place;
  Dataset data = load_dataset(place.folder / "data");
  const auto write_maps = [&](float depth) {
    for (std::size_t i = 0; i < data.views.size(); ++i) {
      View& view = data.views[i];
      view.depth_path = place.folder / (std::to_string(i) + ".npy");
      const auto pixels = static_cast<std::size_t>(view.camera.width * view.camera.height);
      write_depth_file(view.depth_path, view.camera.width, view.camera.height,
                       std::vector<float>(pixels, depth));
    }
  };
  write_maps(4000);
  const auto trainer = [&](const char* name, double weight) {
    TrainOptions options = growing();
    options.depth_weight = weight;
    return std::make_unique<Trainer>(shared_test_context(), data, options, place.run(name));
  };
  const auto resumed_at = [&](const char* name, double weight) {
    const auto out = trainer(name, weight);
    out->resume("latest");
    return out->iteration();
  };
  trainer("photos", 0)->run(false);
  trainer("depths", 0.3)->run(false);
  CHECK(resumed_at("photos", 0.3) == kIterations);
  CHECK(resumed_at("depths", 0) == kIterations);
  CHECK(resumed_at("depths", 0.5) == kIterations);

  write_maps(5000);
  CHECK(resumed_at("photos", 0.3) == kIterations);
  for (const double weight : {0.0, 0.3}) {
    CAPTURE(weight);
    CHECK(contains(message_of<UsageError>([&] { (void)resumed_at("depths", weight); }),
                   "other data"));
  }
}

TEST_CASE("a run of cut-out photos that are taken for others is told how to go on") {
  const Place place;
  Dataset data = load_dataset(place.folder / "data");
  REQUIRE(data.alpha_is_background);
  const auto resumed_at = [&](AlphaUse use, bool cut_out) {
    data.alpha_is_background = cut_out;
    data.read_as->alpha = use;
    Trainer trainer(shared_test_context(), data, growing(), place.run("run"));
    trainer.resume("latest");
    return trainer.iteration();
  };
  Trainer(shared_test_context(), data, growing(), place.run("run")).run(false);
  const std::string advice = "if they were, resume with --alpha cutout";
  const LogCapture log;
  CHECK(resumed_at(AlphaUse::kAuto, true) == kIterations);
  CHECK(resumed_at(AlphaUse::kCutout, true) == kIterations);
  CHECK_FALSE(log.contains(advice));
  CHECK(resumed_at(AlphaUse::kAuto, false) == kIterations);
  CHECK(log.contains(advice));
}

TEST_CASE("a run says how its data set was read, and options that say otherwise are refused") {
  const Place place;
  DatasetOptions halved;
  halved.downscale = 2;
  halved.masks = MaskUse::kCutout;
  const Dataset data = load_dataset(place.folder / "data", halved);
  TrainOptions options = growing();
  const auto train = [&] {
    Trainer(shared_test_context(), data, options, place.run("run"), true).run(false);
    TrainOptions said;
    read_train_config(place.run("run") / "config.toml", said);
    return said;
  };
  const TrainOptions left_open = train();
  CHECK(left_open.data.downscale == 2);
  CHECK(left_open.data.masks == MaskUse::kCutout);
  options.data = halved;
  CHECK(train().data.downscale == 2);
  options.data.downscale = 4;
  CHECK(contains(message_of<UsageError>([&] { (void)train(); }),
                 "say 'downscale' = 4, and its data set was read with 2: read it with the same"));
}

TEST_CASE("a run is not resumed where files of its data set hold out other photos than before") {
  const Place place;
  place.trainer(growing(), "run")->run(false);
  CHECK_FALSE(load_latest_checkpoint(place.run("run")).split.empty());
  Dataset data = load_dataset(place.folder / "data");
  const auto resume = [&] {
    Trainer(shared_test_context(), data, growing(), place.run("run")).resume("latest");
  };
  resume();
  View& other = data.views[data.indices(Split::kTrain).front()];
  other.test = true;
  CHECK(contains(message_of<UsageError>(resume), "bring their lists back"));
  data.read_as->test_list = {other.camera.name};
  CHECK(contains(message_of<UsageError>(resume), "leave that to the run's configuration"));
  data.views.pop_back();  // which a list leaves out
  CHECK(contains(message_of<UsageError>(resume),
                 "resume with the photos, cameras and 'test-list' or 'test-every' of the run"));
  data.read_as->test_list.reset();
  CHECK(contains(message_of<UsageError>(resume),
                 "resume with the photos, cameras and lists of held-out photos of the run"));
}

TEST_CASE("a run of a program that knew no lists beside COLMAP models is not resumed with one") {
  const Place place;
  Dataset data = load_dataset(place.folder / "data");
  data.kind = DatasetKind::kColmap;  // as it would be read from such files
  data.test_every = 8;
  TrainOptions options = growing();
  Trainer(shared_test_context(), data, options, place.run("run")).run(false);
  const fs::path file = list_checkpoints(place.run("run")).back();
  Checkpoint older = read_checkpoint(file);
  older.split.clear();
  CheckpointSections sections;
  for (const auto& [name, numbers] : older.sections)
    sections[name] = [&numbers = numbers] { return numbers; };
  write_checkpoint(file, older, sections);
  const auto resume = [&] {
    Trainer(shared_test_context(), data, options, place.run("run")).resume("latest");
  };
  resume();
  data.test_every = 0;
  const std::string refusal = "was made before lists of test photos beside COLMAP models counted";
  CHECK(contains(message_of<UsageError>(resume), refusal));
  for (View& view : data.views) view.test = false;  // all are to be trained on
  CHECK(contains(message_of<UsageError>(resume), refusal));
  data.views.pop_back();  // the list leaves one out
  CHECK(contains(message_of<UsageError>(resume), refusal));
}

TEST_CASE("a run that does not say how its data set was read goes on, and is warned of") {
  const Place place;
  DatasetOptions smaller;
  smaller.downscale = 2;
  smaller.test_every = 4;
  Dataset data = load_dataset(place.folder / "data", smaller);
  const auto read_as = std::exchange(data.read_as, std::nullopt);
  Trainer(shared_test_context(), data, growing(), place.run("run")).run(false);
  const LogCapture log;
  const auto resumed_at = [&] {
    Trainer trainer(shared_test_context(), data, growing(), place.run("run"));
    trainer.resume("latest");
    return trainer.iteration();
  };
  CHECK(resumed_at() == kIterations);
  CHECK_FALSE(log.contains("does not say how"));
  data.read_as = read_as;
  CHECK(resumed_at() == kIterations);
  CHECK(log.contains("does not say how"));
}
