// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "raysplats/error.hpp"
#include "raysplats/trainer.hpp"
#include "run/train_option_table.hpp"
#include "unit/fixture.hpp"
#include "unit/text.hpp"
#include "unit/train/photographed.hpp"

using namespace raysplats;
using test::contains;
using test::message_of;

namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

std::string refusal(const TrainOptions& options) {
  return message_of<UsageError>([&] { check_train_options(options); });
}

// Every member that is no whole number.
std::vector<double*> reals_of(TrainOptions& o) {
  std::vector<double*> out{
      &o.data.downscale,     &o.init_opacity,  &o.ssim_weight,   &o.exposure_damping,
      &o.depth_weight,       &o.depth_unit,    &o.color_range,   &o.lr_decay,
      &o.adam_beta1,         &o.adam_beta2,    &o.adam_epsilon,  &o.densify_grad_threshold,
      &o.densify_size,       &o.split_factor,  &o.prune_opacity, &o.prune_scale,
      &o.prune_scale_min,    &o.opacity_decay, &o.opacity_reg,   &o.scale_reg,
      &o.mcmc_noise,         &o.footprint,     &o.scale_min,     &o.scale_max,
      &o.opacity_reset_value};
  out.insert(out.end(), {&o.alpha_weight, &o.prune_weight});
  for (LearningRate* rate : {&o.position_lr, &o.rotation_lr, &o.scale_lr, &o.opacity_lr, &o.sh_lr,
                             &o.sh_rest_lr, &o.sky_lr, &o.pose_lr}) {
    out.push_back(&rate->initial);
    out.push_back(&rate->final_value);
  }
  for (RunShare* share : {&o.sh_degree_interval, &o.average_from, &o.densify_from, &o.densify_until,
                          &o.densify_every, &o.replace_until})
    out.push_back(&share->value);
  return out;
}

struct Photos : Photographed {
  Photos()
      : Photographed(coloured_cloud(20, 0.6, 21, 0.0f),
                     {look_at({3, 0, 1}, {0, 0, 0}, {0, 0, 1}, 16, 16, 18),
                      look_at({0, 3, 1}, {0, 0, 0}, {0, 0, 1}, 16, 16, 18)}) {}
};

}  // namespace

TEST_CASE("options that are no number are refused by their names") {
  TrainOptions options;
  CHECK(refusal(options) == "");
  const std::vector<double*> reals = reals_of(options);
  for (double* real : reals) {
    const double was = std::exchange(*real, kNaN);
    int found = 0;
    for (const OptionRow& row : train_option_rows(options)) {
      if (row.text() != "nan") continue;
      CAPTURE(row.name);
      CHECK(contains(refusal(options), "The option '" + row.name + "' needs a "));
      ++found;
    }
    CHECK(found == 1);
    *real = was;
  }
  CHECK(refusal(options) == "");
  options.eval_at = {0.5, kNaN};
  CHECK(contains(refusal(options), "'eval-at'"));
  options.eval_at = {};
  options.resolution_schedule = {{2, kNaN}};
  CHECK(contains(refusal(options), "'resolution-schedule'"));
  options.resolution_schedule = {};
  options.bounds = Bounds{{0, 0, kNaN}, {1, 1, 1}};
  CHECK(contains(refusal(options), "'bounds'"));
}

TEST_CASE("marks of what fits a run, and paths of any spelling, are no wrong options") {
  TrainOptions options;
  options.iterations = kFittedLength;
  options.init_opacity = options.opacity_decay = kFitted;
  options.position_lr = options.scale_lr = options.sh_rest_lr = {kFitted, kFitted};
  options.rotation_lr.final_value = options.opacity_lr.final_value = options.sh_lr.final_value =
      kFitted;
  options.seed = std::numeric_limits<std::uint64_t>::max();
  options.trace.memory_budget = 1;
  options.image_budget = 0;
  options.background = "0.1,0.2,0.3";
  options.init = "C:\\models\\it's.ply";
  CHECK(contains(refusal(options), "'init'"));  // no configuration could name it
  options.init = "C:\\models\\a.ply";
  options.mirrors = {"/a, b/[1].obj", "/c\\d.obj", "/it's.obj"};
  options.bounds = Bounds{{-1, -1, 0}, {1, 1, 2}};
  options.data.origin = {1e6, -2.5, 0};
  CHECK(refusal(options) == "");
}

TEST_CASE("a trainer refuses options that no configuration could have, before it runs") {
  Photos photos;
  const auto refused = [&](void (*change)(TrainOptions&)) {
    TrainOptions options;
    options.iterations = 10;
    change(options);
    return message_of<UsageError>(
        [&] { Trainer(photos.context, photos.dataset, options, photos.folder / "run"); });
  };
  CHECK(refused([](TrainOptions&) {}) == "");
  CHECK(refused([](TrainOptions& o) { o.sh_degree = 9; }) ==
        "The option 'sh-degree' needs a whole number from 0 to 4, not '9'");
  CHECK(contains(refused([](TrainOptions& o) { o.image_budget = -1; }), "'image-budget'"));
  CHECK(contains(refused([](TrainOptions& o) { o.views_per_step = 0; }), "'views-per-step'"));
  CHECK(contains(refused([](TrainOptions& o) { o.split_factor = 0; }), "'split-factor'"));
  CHECK(contains(refused([](TrainOptions& o) { o.log_every = 0; }), "'log-every'"));
  CHECK(contains(refused([](TrainOptions& o) { o.average_from = kNaN; }), "'average-from'"));
  CHECK(contains(refused([](TrainOptions& o) { o.footprint = kNaN; }), "'footprint'"));
  CHECK(contains(refused([](TrainOptions& o) { o.save_at = {kNaN}; }), "'save-at'"));
  CHECK(refused([](TrainOptions& o) { o.strategy = static_cast<DensityStrategy>(7); }) ==
        "The option 'strategy' is budget or adc or mcmc, not a value without a name");
  CHECK(contains(refused([](TrainOptions& o) { o.pixel_loss = static_cast<PixelLoss>(-1); }),
                 "'pixel-loss'"));
  CHECK(contains(refused([](TrainOptions& o) { o.trace.traversal = static_cast<Traversal>(9); }),
                 "'traversal'"));
}
