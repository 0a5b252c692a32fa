// SPDX-License-Identifier: Apache-2.0
#include "train/unused_options.hpp"

#include <doctest/doctest.h>

#include <filesystem>

#include "build_paths.hpp"
#include "run/train_config.hpp"
#include "unit/temporary_directory.hpp"

using namespace raysplats;

TEST_CASE("options that nothing of a run reads are named with what would") {
  TrainOptions options;
  CHECK(unused_options(options) == "");
  options.prune_scale = 0.1;
  options.densify_grad_threshold = 1e-3;
  options.replace_until = 0.7;
  options.densify_signal = DensifySignal::kScreen;
  CHECK(unused_options(options) == "densify-grad-threshold, prune-scale (for strategy = adc)");
  options.strategy = DensityStrategy::kMcmc;
  options.opacity_decay = 0.02;
  options.prune_weight = 0.01;
  CHECK(unused_options(options) ==
        "densify-grad-threshold, prune-scale (for strategy = adc), densify-signal (for strategy = "
        "budget or adc), prune-weight, opacity-decay (for strategy = budget)");
  options.strategy = DensityStrategy::kAdc;
  options.scale_reg = 0.1;
  CHECK(
      unused_options(options) ==
      "replace-until (for strategy = budget or mcmc), prune-weight, opacity-decay (for strategy = "
      "budget), scale-reg (for strategy = mcmc)");

  options = TrainOptions();
  options.sky_lr.final_value = 2e-3;
  options.opacity_reset_value = 0.1;
  options.mirror_bounces = 2;
  options.init_count = 100;
  CHECK(unused_options(options) ==
        "opacity-reset-value (for opacity-reset-every), sky-lr-final (for background = sky), "
        "mirror-bounces (for mirrors)");
  options.background = "sky";
  options.opacity_reset_every = 100;
  options.mirrors = {"mirror.obj"};
  CHECK(unused_options(options) == "");
  options.init = "model.ply";
  CHECK(unused_options(options) == "init-count (for starts that are no model)");
}

TEST_CASE("what a run chose of its options is none that it does not read") {
  TrainOptions options;
  options.init = "random";
  options.iterations = 700;
  options.end_iteration = 650;
  options.max_gaussians = 5000;
  options.photo_points = false;
  options.resolution_schedule = {};
  options.background = "0.5,0.5,0.5";
  options.color_range = 0.6;
  CHECK(unused_options(options) == "");
}

TEST_CASE("configurations that come with the program have none that they do not read") {
  int files = 0;
  for (const auto& entry :
       std::filesystem::directory_iterator(std::filesystem::path(test::source_dir()) / "configs")) {
    if (entry.path().extension() != ".toml") continue;
    CAPTURE(entry.path());
    TrainOptions options;
    read_train_config(entry.path(), options);
    CHECK(unused_options(options) == "");
    ++files;
  }
  CHECK(files >= 3);
}
