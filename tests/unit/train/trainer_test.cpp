// SPDX-License-Identifier: Apache-2.0
#include "raysplats/trainer.hpp"

#include <doctest/doctest.h>
#include <fmt/format.h>
#include <xxhash.h>

#include <chrono>
#include <cmath>
#include <csignal>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>

#include "raysplats/device.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "run/checkpoint.hpp"
#include "run/train_config.hpp"
#include "train/memory_estimate.hpp"
#include "unit/fixture.hpp"
#include "unit/train/photographed.hpp"
#include "unit/train/short_training.hpp"

using namespace raysplats;

namespace {

constexpr int kWidth = 40;
constexpr int kHeight = 32;

std::vector<Camera> cameras_around() {
  std::vector<Camera> out;
  for (int i = 0; i < 10; ++i) {
    const double angle = 0.628 * i;
    out.push_back(look_at({3 * std::cos(angle), 3 * std::sin(angle), 1.0 + 0.1 * i}, {0, 0, 0},
                          {0, 0, 1}, kWidth, kHeight, 48));
  }
  return out;
}

struct Photos : Photographed {
  Photos() : Photographed(coloured_cloud(60, 0.6, 11), cameras_around()) {}
};

TrainOptions small_options() {
  TrainOptions options;
  options.iterations = 40;
  options.init_count = 300;
  options.max_gaussians = 500;
  options.sh_degree = 1;
  options.sh_degree_interval = 15;
  options.densify_from = 10;
  options.densify_until = 30;
  options.densify_every = 10;
  options.densify_grad_threshold = 1e-5;
  options.prune_opacity = 0.05;
  options.opacity_reset_every = 0;
  options.resolution_schedule = {{2, 12}};
  options.log_every = 5;
  options.eval_at = {};
  options.save_at = {};
  options.checkpoint_every = 0;
  options.trace.memory_budget = std::size_t{64} << 20;
  return options;
}

std::vector<std::string> lines_of(const std::filesystem::path& path) {
  std::ifstream stream(path);
  std::vector<std::string> lines;
  for (std::string line; std::getline(stream, line);) lines.push_back(line);
  return lines;
}

// Whether a signal ends the run.
bool is_interrupted(Trainer& trainer) {
  try {
    trainer.run(false);
  } catch (const Error& error) {
    return error.code() == ErrorCode::kInterrupted;
  }
  return false;
}

}  // namespace

TEST_CASE("a resumed run ends with the bytes of an uninterrupted one") {
  Photos photos;
  TrainOptions options = small_options();
  options.trace.deterministic = true;  // elsewhere than on CPUs gradients are atomic sums otherwise
  Trainer straight(photos.context, photos.dataset, options, photos.folder / "straight");
  const TrainSummary summary = straight.run(false);
  CHECK(summary.iterations == 40);
  CHECK(summary.gaussians != 300);
  CHECK(summary.gaussians <= 500);
  REQUIRE(summary.evaluations.size() == 1);
  CHECK(summary.evaluations[0].views == 2);

  // An interrupt after iteration 20 leaves exactly this checkpoint; density control took place in
  // 10 and 20.
  const auto broken = photos.folder / "broken";
  {
    TrainOptions checkpoints = options;
    checkpoints.checkpoint_every = 20;
    checkpoints.keep_checkpoints = 5;
    Trainer first(photos.context, photos.dataset, checkpoints, broken);
    first.run(false);
    CHECK(list_checkpoints(broken).size() == 2);
    std::filesystem::remove(checkpoint_path(broken, 40));
  }
  Trainer second(photos.context, photos.dataset, options, broken);
  second.resume(broken);
  CHECK(second.iteration() == 20);
  second.run(false);
  CHECK(second.iteration() == 40);
  check_equal(straight.gaussians().download(), second.gaussians().download());
  const Checkpoint a = load_latest_checkpoint(photos.folder / "straight");
  const Checkpoint b = load_latest_checkpoint(broken);
  CHECK(a.sections == b.sections);
  CHECK(a.optimiser_steps == 40);

  // One row per report, none twice.
  CHECK(lines_of(broken / "metrics.csv").size() == 1 + 8);
  CHECK(nlohmann::json::parse(std::ifstream(broken / "metrics.json")).at("evaluations").size() ==
        1);
  TrainOptions other = options;
  other.sh_degree = 2;
  Trainer misfit(photos.context, photos.dataset, other, broken);
  CHECK_THROWS_AS(misfit.resume(broken), UsageError);
}

TEST_CASE("rays that reach the cap on hits are counted over the whole run, resumed ones included") {
  Photos photos;
  TrainOptions options = small_options();
  options.trace.max_hits = 5;
  options.trace.deterministic = true;  // two runs of atomic sums cap other rays
  const auto metrics_of = [](const std::filesystem::path& run) {
    return nlohmann::json::parse(std::ifstream(run / "metrics.json"));
  };
  const auto straight = photos.folder / "straight";
  Trainer(photos.context, photos.dataset, options, straight).run(false);
  // Half the pixels a side up to iteration 12.
  constexpr std::uint64_t kPixels = kWidth * kHeight;
  constexpr std::uint64_t kRays = 12 * kPixels / 4 + 28 * kPixels;
  const std::uint64_t capped = metrics_of(straight).at("capped_rays");
  CHECK(metrics_of(straight).at("traced_rays") == kRays);
  CHECK(capped > 4 * kPixels);  // more than any view has
  CHECK(capped < kRays);

  const auto broken = photos.folder / "broken";
  TrainOptions half = options;
  half.checkpoint_every = 20;
  half.keep_checkpoints = 5;
  Trainer(photos.context, photos.dataset, half, broken).run(false);
  std::filesystem::remove(checkpoint_path(broken, 40));
  for (int round = 0; round < 2; ++round) {  // at 20, then with nothing left to do
    CAPTURE(round);
    Trainer again(photos.context, photos.dataset, options, broken);
    again.resume(broken);
    CHECK(again.iteration() == (round == 0 ? 20 : 40));
    again.run(false);
    CHECK(metrics_of(broken).at("capped_rays") == capped);
    CHECK(metrics_of(broken).at("traced_rays") == kRays);
  }
}

TEST_CASE("a run resumed between two passes of density control ends with the same bytes") {
  Photos photos;
  TrainOptions options = small_options();
  options.trace.deterministic = true;
  options.footprint = 3.0;  // nearly every axis is at its least size
  options.position_lr = {2e-2, 2e-2};
  Trainer straight(photos.context, photos.dataset, options, photos.folder / "straight");
  straight.run(false);
  const auto broken = photos.folder / "broken";
  {
    TrainOptions checkpoints = options;
    checkpoints.checkpoint_every = 17;
    checkpoints.keep_checkpoints = 5;
    Trainer first(photos.context, photos.dataset, checkpoints, broken);
    first.run(false);
    std::filesystem::remove(checkpoint_path(broken, 40));
    std::filesystem::remove(checkpoint_path(broken, 34));
  }
  Trainer second(photos.context, photos.dataset, options, broken);
  second.resume(broken);
  CHECK(second.iteration() == 17);
  second.run(false);
  check_equal(straight.gaussians().download(), second.gaussians().download());
}

// A run of 250 iterations that is measured at its tenth and at its end.
TrainOptions measured_options() {
  TrainOptions options = small_options();
  options.iterations = 250;
  options.densify_until = 150;
  options.eval_at = {10};
  options.eval_renders = 1;
  options.save_at = {100};
  options.position_lr = {2e-3, 2e-4};
  options.sh_lr = {2e-2, 5e-3};
  return options;
}

TEST_CASE("training improves held-out views") {
  Photos photos;
  TrainOptions options = measured_options();
  // Single runs of eight tiny photos differ by decibels.
  constexpr std::uint64_t kSeeds = 24;
  double gain = 0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    options.seed = seed;
    Trainer trainer(photos.context, photos.dataset, options, photos.folder / std::to_string(seed));
    const TrainSummary summary = trainer.run(false);
    REQUIRE(summary.evaluations.size() == 2);
    gain += (summary.evaluations[1].psnr - summary.evaluations[0].psnr) / kSeeds;
  }
  MESSAGE("PSNR rises by " << gain << " dB");
  CHECK(gain > 3.0);
}

TEST_CASE("training leaves the files of a run") {
  Photos photos;
  TrainOptions options = measured_options();
  const auto folder = photos.folder / "run";
  Trainer trainer(photos.context, photos.dataset, options, folder);
  trainer.set_command("train '\xFF'");
  const TrainSummary summary = trainer.run(false);
  REQUIRE(summary.evaluations.size() == 2);
  CHECK(summary.evaluations[1].psnr > summary.evaluations[0].psnr);
  CHECK(summary.evaluations[1].ssim > summary.evaluations[0].ssim);
  CHECK(summary.training_seconds > 0);

  TrainOptions read;
  read_train_config(folder / "config.toml", read);
  // Photos on black ground: that is their background, which the configuration names.
  CHECK(read.background.starts_with("0.00"));
  options.background = read.background;
  CHECK(read.color_range > 0.5);
  CHECK(read.color_range <= 1.0);
  options.color_range = read.color_range;
  options.data.origin = read.data.origin;  // which the run has found
  CHECK(to_toml(read) == to_toml(options));
  CHECK(nlohmann::json::parse(std::ifstream(folder / "cameras.json")).size() == 8);
  CHECK(read_ply(folder / "point_cloud" / "iteration_250" / "point_cloud.ply").size() ==
        summary.gaussians);
  CHECK(std::filesystem::exists(folder / "point_cloud" / "iteration_100" / "point_cloud.ply"));
  const auto eval = folder / "eval" / "iteration_250";
  const nlohmann::json judged = nlohmann::json::parse(std::ifstream(eval / "metrics.json"));
  const nlohmann::json& views = judged.at("images");
  const bool first_is_worst = views.at(0).at("psnr") <= views.at(1).at("psnr");
  const Image pictures = read_image(eval / (first_is_worst ? "view_0.png" : "view_5.png"));
  CHECK(pictures.width == 3 * kWidth);
  CHECK(pictures.height == kHeight);
  CHECK(!std::filesystem::exists(eval / (first_is_worst ? "view_5.png" : "view_0.png")));
  const nlohmann::json metrics = nlohmann::json::parse(std::ifstream(folder / "metrics.json"));
  CHECK(metrics.at("complete") == true);
  CHECK(metrics.at("iteration") == 250);
  CHECK(metrics.at("most_gaussians") == options.max_gaussians);
  CHECK(metrics.at("seed") == options.seed);
  CHECK(!metrics.at("data").get<std::string>().empty());
  // Steps 16, 48, 80 and so on are timed, and once more where one is made again.
  const std::int64_t timed = metrics.at("timed_steps");
  CHECK(timed >= 8);
  CHECK(timed <= 10);
  double share = 0.0;
  std::int64_t steps = 0;
  for (const nlohmann::json& kernel : metrics.at("kernels")) {
    share += kernel.at("share").get<double>();
    if (kernel.at("name") == "guard_close") steps = kernel.at("calls");
  }
  CHECK(share == doctest::Approx(1.0));
  CHECK(steps == timed);
  CHECK(metrics.at("photos").at(0).at("psnr") > 10.0);
  CHECK(metrics.at("command") == "train '\xEF\xBF\xBD'");  // what is no UTF-8 is replaced
  std::ifstream model(folder / "point_cloud/iteration_250/point_cloud.ply", std::ios::binary);
  const std::string bytes((std::istreambuf_iterator<char>(model)), {});
  XXH128_canonical_t canonical;
  XXH128_canonicalFromHash(&canonical, XXH3_128bits(bytes.data(), bytes.size()));
  std::string hash;
  for (const unsigned char digit : canonical.digest) hash += fmt::format("{:02x}", digit);
  CHECK(metrics.at("model_hash") == hash);
  CHECK(views.at(0).at("center").size() == 3);
  CHECK(views.at(0).at("sharpness") > 0.0);
}

TEST_CASE("a run without a length is planned by its photos, and refuses what is none") {
  Photos photos;
  TrainOptions options = small_options();
  options.iterations = kFittedLength;
  const Trainer fitted(photos.context, photos.dataset, options, photos.folder / "fitted");
  CHECK(fitted.iterations() == 1000);
  // In order by itself, but not in 1000 iterations.
  options.resolution_schedule = {{4, 0.5}, {2, 400}};
  CHECK_THROWS_AS(Trainer(photos.context, photos.dataset, options, photos.folder / "sizes"),
                  UsageError);
  options.resolution_schedule = {};
  options.iterations = -5;
  CHECK_THROWS_AS(Trainer(photos.context, photos.dataset, options, photos.folder / "none"),
                  UsageError);
}

TEST_CASE("a signal ends the run with everything saved") {
  Photos photos;
  TrainOptions options = small_options();
  options.iterations = 1000000;
  options.log_every = 1;
  const auto folder = photos.folder / "run";
  const std::jthread killer([&folder](const std::stop_token& token) {
    while (!token.stop_requested() && lines_of(folder / "metrics.csv").size() < 3) {
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    if (!token.stop_requested()) std::raise(SIGTERM);
  });
  Trainer trainer(photos.context, photos.dataset, options, folder);
  CHECK(is_interrupted(trainer));
  const std::int64_t done = trainer.iteration();
  CHECK(load_latest_checkpoint(folder).iteration == done);
  CHECK(std::filesystem::exists(folder / "point_cloud" / ("iteration_" + std::to_string(done)) /
                                "point_cloud.ply"));
}

TEST_CASE("a signal breaks off the last evaluation, which the resumed run makes up for") {
  Photos photos;
  TrainOptions options = small_options();
  options.eval_at = {};
  const auto folder = photos.folder / "run";
  const auto is_complete = [&] {
    return nlohmann::json::parse(std::ifstream(folder / "metrics.json")).at("complete") == true;
  };
  {
    Trainer trainer(photos.context, photos.dataset, options, folder);
    trainer.on_step([&](const TrainProgress& progress) {
      if (progress.iteration == progress.iterations) std::raise(SIGTERM);
    });
    CHECK(is_interrupted(trainer));
    CHECK(trainer.iteration() == options.iterations);
  }
  CHECK_FALSE(is_complete());
  const auto name = "iteration_" + std::to_string(options.iterations);
  CHECK(load_latest_checkpoint(folder).iteration == options.iterations);
  CHECK(std::filesystem::exists(folder / "point_cloud" / name / "point_cloud.ply"));
  CHECK_FALSE(std::filesystem::exists(folder / "eval" / name));
  Trainer resumed(photos.context, photos.dataset, options, folder);
  resumed.resume("latest");
  CHECK(resumed.run(false).evaluations.size() == 1);
  CHECK(is_complete());
  CHECK(std::filesystem::exists(folder / "eval" / name / "metrics.json"));
}

TEST_CASE("stop() breaks off the last evaluation, and evaluate() makes it afterwards") {
  Photos photos;
  TrainOptions options = small_options();
  options.eval_at = {};
  Trainer trainer(photos.context, photos.dataset, options, photos.folder / "run");
  trainer.on_step([&](const TrainProgress& progress) {
    if (progress.iteration == progress.iterations) trainer.stop();
  });
  const TrainSummary summary = trainer.run(false);
  CHECK(summary.iterations == options.iterations);
  CHECK(summary.evaluations.empty());
  CHECK(trainer.evaluate().iteration == options.iterations);
}

TEST_CASE("a loss that is not finite stops the run and names the iteration") {
  Photos photos;
  Gaussians model;
  model.resize(1);
  model.log_scales = {-1, -1, -1};
  model.opacities = {3};
  model.sh = {1e30f, 1e30f, 1e30f};
  write_ply(photos.folder / "start.ply", model);
  TrainOptions options = small_options();
  options.init = (photos.folder / "start.ply").string();
  options.pixel_loss = PixelLoss::kL2;
  options.log_every = 1;
  Trainer trainer(photos.context, photos.dataset, options, photos.folder / "run");
  std::string message;
  try {
    trainer.run(false);
  } catch (const Error& error) {
    message = error.what();
  }
  CHECK(message.find("iteration 1") != std::string::npos);
}

TEST_CASE("a least scale that a sigmoid does not reach is refused") {
  Photos photos;
  TrainOptions options = small_options();
  options.scale_activation = ScaleActivation::kSigmoid;
  options.scale_min = 10.0;
  CHECK_THROWS_AS(Trainer(photos.context, photos.dataset, options, photos.folder / "run"),
                  UsageError);
  options.scale_min = 1e-3;
  CHECK_NOTHROW(Trainer(photos.context, photos.dataset, options, photos.folder / "run"));
}

TEST_CASE("a device with too little memory is refused with the figures") {
  Photos photos;
  TrainOptions options = small_options();
  options.max_gaussians = 2000000000;
  Trainer trainer(photos.context, photos.dataset, options, photos.folder / "run");
  std::string message;
  try {
    trainer.run(false);
  } catch (const ResourceError& error) {
    message = error.what();
  }
  CHECK(message.find("MiB") != std::string::npos);
  CHECK(message.find("--max-gaussians") != std::string::npos);
  DeviceInfo small = photos.context.device();
  small.global_memory = std::uint64_t{4} << 30;
  small.max_allocation = 1 << 20;
  CHECK_THROWS_AS(check_memory(small_options(), {100000, 1000, 10}, small), ResourceError);
  Dataset empty = photos.dataset;
  for (View& view : empty.views) view.test = true;
  message.clear();
  try {
    const Trainer refused(photos.context, empty, small_options(), photos.folder / "run");
  } catch (const UsageError& error) {
    message = error.what();
  }
  CHECK(message.find("its files hold all of them out") != std::string::npos);
}
