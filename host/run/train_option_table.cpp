// SPDX-License-Identifier: Apache-2.0
#include "run/train_option_table.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <optional>
#include <string>
#include <utility>

#include "io/dataset/data_option_table.hpp"
#include "raysplats/error.hpp"
#include "scene/options/trace_option_table.hpp"
#include "util/number_text.hpp"

namespace raysplats {
namespace {

using Values = OptionTable::Values;

constexpr double kHuge = kNoBound;
constexpr double kMaxCount = 1e15;
// Extents of the scene. Far beyond, squares of scales leave single precision.
constexpr double kMostScaleMin = 1e6;

// A share of the run (below 1) or a whole number of iterations.
RunShare parse_share(const std::string& key, const std::string& text, bool may_be_none) {
  const std::optional<std::int64_t> count = parse_whole(text);
  const double value = count ? static_cast<double>(*count) : parse_real(text).value_or(-1);
  const bool whole = count && value >= 1 && value <= kMaxCount;
  const bool share = value > 0 && value < 1;
  if (!(whole || share || (may_be_none && value == 0))) {
    throw UsageError(
        fmt::format("The option '{}' needs a share of the run below 1 or a whole number of "
                    "iterations{}, not '{}'",
                    key, may_be_none ? " (0 = none)" : "", text));
  }
  return value;
}

std::string share_text(const RunShare& share) { return fmt::format("{}", share.value); }

// "4:0.1": a fourth of the size up to a tenth of the run. Plain numbers halve the divisor down to
// 1: of n entries the first starts at 2^n.
std::vector<ResolutionStep> parse_resolutions(const std::string& key, const Values& values) {
  const std::vector<std::string> entries = option_items(key, values);
  const auto named = std::count_if(entries.begin(), entries.end(), [](const std::string& entry) {
    return entry.find(':') != std::string::npos;
  });
  if (named != 0 && static_cast<std::size_t>(named) != entries.size()) {
    throw UsageError(fmt::format(
        "The option '{}' takes either divisor:until pairs or plain iterations, not both", key));
  }
  if (named == 0 && entries.size() > 6) {
    throw UsageError(
        fmt::format("The option '{}' takes at most 6 iterations (1/64 of the size)", key));
  }
  std::vector<ResolutionStep> out;
  for (std::size_t i = 0; i < entries.size(); ++i) {
    const std::size_t colon = entries[i].find(':');
    ResolutionStep step;
    step.divisor = named > 0 ? option_number<int>(key, entries[i].substr(0, colon), 1, 64)
                             : 1 << (entries.size() - i);
    step.until = parse_share(key, named > 0 ? entries[i].substr(colon + 1) : entries[i], false);
    out.push_back(step);
  }
  return out;
}

// The kinds of options that only a run has.
class TrainTable : public OptionTable {
 public:
  void share(const std::string& name, RunShare& target, bool may_be_none, const std::string& help) {
    add(
        name, help,
        [name, &target, may_be_none](const Values& values) {
          target = parse_share(name, option_value(name, values), may_be_none);
        },
        [&target] { return share_text(target); });
  }

  void shares(const std::string& name, std::vector<RunShare>& target, const std::string& help) {
    add(
        name, help,
        [name, &target](const Values& values) {
          std::vector<RunShare> parsed;
          for (const std::string& entry : option_items(name, values))
            parsed.push_back(parse_share(name, entry, false));
          target = std::move(parsed);
        },
        [&target] {
          std::vector<std::string> texts;
          texts.reserve(target.size());
          for (const RunShare& entry : target) texts.push_back(share_text(entry));
          return fmt::format("[{}]", fmt::join(texts, ", "));
        },
        OptionRow::List::kNumbers);
  }

  void resolutions(const std::string& name,
                   std::vector<ResolutionStep>& target,
                   const std::string& help) {
    add(
        name, help,
        [name, &target](const Values& values) { target = parse_resolutions(name, values); },
        [&target] {
          std::vector<std::string> texts;
          texts.reserve(target.size());
          for (const ResolutionStep& step : target)
            texts.push_back(fmt::format("\"{}:{}\"", step.divisor, share_text(step.until)));
          return fmt::format("[{}]", fmt::join(texts, ", "));
        },
        OptionRow::List::kNumbers);
  }

  // Six numbers, the corners with the least and the greatest coordinates; none = unbounded.
  void box(const std::string& name, std::optional<Bounds>& target, const std::string& help) {
    add(
        name, help,
        [name, &target](const Values& values) {
          const std::vector<std::string> entries = option_items(name, values);
          target.reset();
          if (entries.empty()) return;
          Bounds box;
          bool good = entries.size() == 6;
          for (std::size_t k = 0; good && k < 3; ++k) {
            const std::optional<double> low = parse_real(entries[k]);
            const std::optional<double> high = parse_real(entries[k + 3]);
            good = low && high && *low < *high;
            if (good) box.low[k] = *low, box.high[k] = *high;
          }
          if (!good) {
            throw UsageError(
                fmt::format("The option '{}' is the least and then the greatest x, y and z of a "
                            "box as in -1,-1,0,1,1,2, not '{}'",
                            name, fmt::join(values, " ")));
          }
          target = box;
        },
        [&target] {
          if (!target) return std::string("[]");
          return fmt::format("[{}, {}]", fmt::join(target->low, ", "),
                             fmt::join(target->high, ", "));
        },
        OptionRow::List::kNumbers);
  }

  void learning_rate(const std::string& name, LearningRate& rate, const std::string& help) {
    number(name, rate.initial, 0, 1e3, "learning rate of " + help);
    number(name + "-final", rate.final_value, 0, 1e3, "value that " + name + " decays to");
  }
  // The final value of a rate, which kFitted makes what `fit` says.
  void fitted_end(const std::string& name, LearningRate& rate, const std::string& fit) {
    number(name + "-final", rate.final_value, kFitted, 1e3,
           fmt::format("value that {} decays to; -1 = {}", name, fit));
  }
};

void add_run_options(TrainTable& t, TrainOptions& o) {
  t.section("Run");
  t.number(
      "iterations", o.iterations, kFittedLength, kMaxCount,
      "training steps, of one view each or of views-per-step; -1 = 100 for each training photo, "
      "from 1000 to 10000");
  t.number("end-iteration", o.end_iteration, 0, kMaxCount,
           "iteration that the run ends with, though its schedules are those of iterations; --time "
           "sets it once the last steps are timed; 0 = iterations");
  t.number("views-per-step", o.views_per_step, 1, 1024,
           "views of an iteration, whose gradients are added in an order of their own; time and "
           "memory for gradients grow with it");
  t.number("seed", o.seed, 0, kMaxSeed,
           "seed of view order, random start and splits; a run is a function of it");
  t.flag(
      "deterministic", o.trace.deterministic,
      "the same seed gives the same bytes on the same device, whatever the scheduling; CPUs always "
      "do, others add gradients in long integers for it");
}

void add_data_options(TrainTable& t, TrainOptions& o) {
  t.section("Data");
  add_data_options(t, o.data);
  t.flag("leave-out-odd", o.leave_out_odd,
         "from 0.1 of the run on leave out training photos that contradict those from beside "
         "them, as by a wrong pose, a folded reconstruction or a finger before the lens (not with "
         "poses, nor in runs of less than six steps for each photo)");
  t.flag(
      "leave-out-moving", o.leave_out_moving,
      "from 0.2 of the run on leave out what moves or changes from photo to photo, as people and "
      "cars: what a photo shows and the model does not, though others that see the place agree "
      "with it (not with mirrors)");
  t.flag("even-places", o.even_places,
         "draw photos from one place, as where a video stands still, no more often than four times "
         "as many as most places have");
  t.number(
      "validate-views", o.validate_views, 0, 1e6,
      "training views that are kept out of the loss until 0.9 of the run, with poses to its end, "
      "to judge it by every tenth of it (test views influence no run); the best model so far is "
      "kept; 0 = none");
  t.number("patience", o.patience, 0, 10,
           "end the run when so many validations in a row were no better than the best one; 0 = "
           "never");
  t.words("background", o.background,
          "colour behind the Gaussians: \"r,g,b\", \"auto\" (white where photos are cut out by "
          "alpha, else their typical colour, which the run's configuration then names), "
          "\"random\" (another colour per iteration for cut-out photos, else black) or \"sky\" "
          "(trained, by direction; model files name it)");
  t.number("sky-degree", o.sky_degree, 0, 4,
           "degree of the spherical harmonics of a sky; 0 = one trained colour");
  t.number(
      "image-budget", o.image_budget, 0, 1e9,
      "MiB of photos and depth maps kept on the device, and of test photos beside it as far as "
      "those leave room; the others are read again when their turn comes");
  t.resolutions(
      "resolution-schedule", o.resolution_schedule,
      "\"divisor:until\" pairs: photos are reduced by the divisor until that share of the "
      "run, or iteration; plain numbers are iterations at which the size doubles up to "
      "the full one; [] = full size");

  t.paths("mirrors", o.mirrors,
          "meshes (OBJ, PLY, GLB) of mirrors that are known: photos may show the scene in them");
  t.number("mirror-bounces", o.mirror_bounces, 0, 64,
           "mirrors that a ray may meet one after the other; behind the last it is black");
}

void add_start_options(TrainTable& t, TrainOptions& o) {
  t.section("Start");
  t.text(
      "init", o.init,
      "\"colmap\" (sparse points of the data set), \"photos\" (inside what cut-out photos show, "
      "else where neighbouring photos agree), \"random\" (anywhere in sight of the cameras, in the "
      "photos' colours), the path of a model, or \"auto\" (points when there are any, else "
      "photos)");
  t.number("init-count", o.init_count, 0, 1e9,
           "Gaussians of a start without points, or beside few (not of a model); 0 = a share of "
           "max-gaussians");
  t.flag(
      "photo-points", o.photo_points,
      "put points of the photos beside sparse ones where photos tell of depth (init auto; not in "
      "runs by a time below a minute)");
  t.flag("uncovered-points", o.uncovered_points,
         "put points of any depth where there are no sparse ones, as in skies and on plain walls "
         "(init auto)");
  t.number(
      "init-opacity", o.init_opacity, kFitted, 0.9999,
      "opacity of the first Gaussians (not of a model), at least 0.0001; -1 = 0.1, or 0.02 of a "
      "random start (not mcmc)");
  t.box("bounds", o.bounds,
        "box of the model in world units, least and greatest x, y, z as in -1,-1,0,1,1,2: "
        "Gaussians with their mean outside are not made and not kept; [] = everywhere");
}

void add_model_options(TrainTable& t, TrainOptions& o) {
  t.section("Model");
  t.number("sh-degree", o.sh_degree, 0, 4,
           "degree of the spherical harmonics of colour; 0 = plain RGB");
  t.share("sh-degree-interval", o.sh_degree_interval, true,
          "one more band is switched on after every such share of the run, or so many iterations; "
          "0 = all from the start");
  t.choice<ScaleActivation>(
      "scale-activation", o.scale_activation,
      {{"exp", ScaleActivation::kExp}, {"sigmoid", ScaleActivation::kSigmoid}},
      "standard deviation from the trained number: exp (3DGS) or sigmoid (the paper; below 1)");
  t.flag("flat", o.flat,
         "train flat Gaussians: from 0.4 of the run on their shortest axis shrinks, to a hundredth "
         "of the next one");
}

void add_loss_options(TrainTable& t, TrainOptions& o) {
  t.section("Loss");
  t.choice<PixelLoss>("pixel-loss", o.pixel_loss, {{"l1", PixelLoss::kL1}, {"l2", PixelLoss::kL2}},
                      "pixel term: l1 (mean absolute error) or l2 (mean squared error)");
  t.number("ssim-weight", o.ssim_weight, 0, 1,
           "lambda in (1 - lambda) pixel term + lambda (1 - SSIM)");
  t.number("alpha-weight", o.alpha_weight, 0, 1e3,
           "weight of the mean error of coverage in the loss, where photos are cut out: what has "
           "the background's colour is part of the model too, and holes stay open");
  t.flag("exposure", o.exposure,
         "find an affine colour (3 x 4) for each training photo too, for captures whose exposure "
         "or white balance changes; their mean stays the identity, which other views are shown "
         "with");
  t.number("exposure-damping", o.exposure_damping, 1e-6, 1e3,
           "how strongly an affine colour stays where it is when its photo is fitted anew: the "
           "weight of the square of its change beside the mean squared error of the colours");

  t.number("depth-weight", o.depth_weight, 0, 1e3,
           "weight of the mean relative error of depth in the loss, where the data set has depth "
           "maps or sparse points with the photos that show them; 0 = off");
  t.number("depth-unit", o.depth_unit, 1e-12, 1e12,
           "units of the data set for each unit of its depth maps (millimetres in a scene in "
           "metres: 0.001)");

  t.flag("poses", o.poses,
         "train the poses of the training photos too, for captures whose poses are not exact; what "
         "all of them have in common is taken off, so that the model stays where the data set has "
         "it; cameras_refined.json in the run has them");
}

void add_optimiser_options(TrainTable& t, TrainOptions& o) {
  t.section("Optimiser (Adam)");
  t.number(
      "position-lr", o.position_lr.initial, kFitted, 1e3,
      "learning rate of the means, times the scene extent (at most 2.5 times what telephoto lenses "
      "see across, and 1.5 times how far away the nearest parts of the scene are); -1 = 0.0005, or "
      "0.002 after a random start (not mcmc)");
  t.fitted_end("position-lr", o.position_lr, "0.00032 / sqrt(iterations), from 5e-6 to 2e-5");
  t.number("rotation-lr", o.rotation_lr.initial, 0, 1e3, "learning rate of the quaternions");
  t.fitted_end("rotation-lr", o.rotation_lr, "0.095 / sqrt(iterations), from 0.001 to 0.003");
  t.number("scale-lr", o.scale_lr.initial, kFitted, 1e3,
           "learning rate of the scale parameters; -1 = 2.5 / sqrt(iterations), from 0.04 to 0.12");
  t.fitted_end("scale-lr", o.scale_lr, "0.32 / sqrt(iterations), from 0.005 to 0.02");
  t.number("opacity-lr", o.opacity_lr.initial, 0, 1e3, "learning rate of the opacity parameters");
  t.fitted_end("opacity-lr", o.opacity_lr, "1.9 / sqrt(iterations), from 0.03 to 0.1");
  t.number("color-range", o.color_range, 0, 1e6,
           "range of the photos' colours, but for a thousandth of a channel at either end: below "
           "0.8 the next three rates are as much smaller as it is (in fog, at night); 0 = that of "
           "the photos, which the run's configuration then names");
  t.number("sh-lr", o.sh_lr.initial, 0, 1e3, "learning rate of colour (SH band 0)");
  t.fitted_end("sh-lr", o.sh_lr, "0.16 / sqrt(iterations), from 0.0025 to 0.01");
  t.number(
      "sh-rest-lr", o.sh_rest_lr.initial, kFitted, 1e3,
      "learning rate of the SH bands above 0; -1 = 0.095 / sqrt(iterations), from 0.0005 to 0.003");
  t.fitted_end("sh-rest-lr", o.sh_rest_lr, "0.032 / sqrt(iterations), from 0.000125 to 0.001");
  t.learning_rate("sky-lr", o.sky_lr, "the sky");
  t.learning_rate("pose-lr", o.pose_lr, "the poses, in radians and shares of the scene extent");
  t.number("lr-decay", o.lr_decay, 0, 1,
           "rates fall as exp(-lr-decay * iteration) until they meet their final value; 0 = they "
           "reach it "
           "exponentially in the last iteration");
  t.flag("scale-lr-by-extent", o.scale_lr_by_extent,
         "multiply scale-lr by the scene extent, as the paper's code");
  t.number("adam-beta1", o.adam_beta1, 0, 0.999999, "decay of the first moment");
  t.number("adam-beta2", o.adam_beta2, 0, 0.9999999, "decay of the second moment");
  t.number("adam-epsilon", o.adam_epsilon, 1e-30, 1, "added to the root of the second moment");
  t.flag("sparse-adam", o.sparse_adam, "leave Gaussians alone that no ray of the view met");
  t.flag("raise-clamped", o.raise_clamped,
         "Gaussians whose colour fell below black are still made brighter where that helps");
  t.share(
      "average-from", o.average_from, true,
      "share of the run, or iteration, from which on the model is the mean of the parameters of "
      "all steps, once photos have their full size, all SH bands are on and the number of "
      "Gaussians no longer grows; 0 = never");
}

void add_density_options(TrainTable& t, TrainOptions& o) {
  t.section("Density control");
  t.choice<DensityStrategy>(
      "strategy", o.strategy,
      {{"budget", DensityStrategy::kBudget},
       {"adc", DensityStrategy::kAdc},
       {"mcmc", DensityStrategy::kMcmc}},
      "budget: the count grows along a curve to max-gaussians, those with the highest signals are "
      "split along their longest axis; adc: whatever exceeds densify-grad-threshold is cloned or "
      "split (3DGS); mcmc: faint ones become parts of others, and noise moves them (3DGS-MCMC)");
  t.share("densify-from", o.densify_from, true,
          "first share of the run, or iteration, that may add or remove Gaussians");
  t.share("densify-until", o.densify_until, true, "last one that may; 0 = never");
  t.share("densify-every", o.densify_every, true,
          "iterations (or share of the run) between two passes; 0 = whole passes over the photos, "
          "at least some 50 iterations (a tenth of a run below 500) and a hundredth of the run");
  t.share("replace-until", o.replace_until, true,
          "up to here (share of the run, or iteration) passes of the budget and mcmc strategies go "
          "on without growth: what they remove is replaced");
  t.number("densify-grad-threshold", o.densify_grad_threshold, 0, kHuge,
           "mean screen-space gradient above which a Gaussian is cloned or split (adc)");
  t.choice<DensifySignal>(
      "densify-signal", o.densify_signal,
      {{"auto", DensifySignal::kAuto},
       {"screen", DensifySignal::kScreen},
       {"absolute", DensifySignal::kAbsolute},
       {"step", DensifySignal::kStep}},
      "that gradient summed as it is (screen, 3DGS) or in absolute value per ray (absolute, AbsGS; "
      "wants a threshold 2 to 4 times higher), or in its place how far the optimiser has just "
      "moved "
      "the mean, over the scene extent (step, the paper's code); auto = absolute with the budget "
      "strategy; mcmc has none");
  t.number("densify-size", o.densify_size, 0, kHuge,
           "larger ones (times the scene extent) are split, smaller ones cloned (adc)");
  t.choice<SizeMeasure>(
      "densify-measure", o.densify_measure,
      {{"longest", SizeMeasure::kLongest}, {"norm", SizeMeasure::kNorm}},
      "what densify-size, prune-scale and prune-scale-min compare (adc): the longest axis or the "
      "root of the sum of the squares of all three (norm, the paper's code)");
  t.flag("densify-inherit", o.densify_inherit,
         "new Gaussians keep the optimiser's state of the one they come from, as in the paper's "
         "code; else it begins at zero");
  t.number("split-factor", o.split_factor, 1, 100,
           "children of a split are smaller by this factor (adc)");
  t.number("prune-opacity", o.prune_opacity, 0, 1, "Gaussians below this opacity are removed");
  t.number("prune-scale", o.prune_scale, 0, kHuge,
           "Gaussians with a larger axis (times the scene extent) are removed (adc); 0 = none");
  t.number(
      "prune-scale-min", o.prune_scale_min, 0, kHuge,
      "Gaussians whose longest axis is below this (times the scene extent) are removed (adc); 0 = "
      "none");
  t.number(
      "max-gaussians", o.max_gaussians, 0, 2e9,
      "hard limit of the count; the strongest candidates win; 0 = from the photos' pixels, the "
      "iterations and the device's memory");
  t.number("prune-weight", o.prune_weight, 0, 1,
           "Gaussians of which the rays that meet them blend less than this on average are removed "
           "(budget); 0 = none");
  t.number("opacity-decay", o.opacity_decay, kFitted, 0.5,
           "taken off every opacity in each pass of the budget strategy; -1 = 0.01 after a random "
           "start, else 0 up to 100 steps for each photo, rising to 0.01 at 200");
  t.number("opacity-reg", o.opacity_reg, 0, 1e3,
           "weight of the mean opacity in the loss of the mcmc strategy");
  t.number(
      "scale-reg", o.scale_reg, 0, 1e3,
      "weight of the mean standard deviation, over the distance of what the cameras see, in the "
      "loss of the mcmc strategy");
  t.number("mcmc-noise", o.mcmc_noise, 0, 1e6,
           "noise that the mcmc strategy adds to the means of Gaussians whose opacity is near "
           "0.005, times their covariance over the same distance; falls as position-lr does");
  t.number("footprint", o.footprint, 0, 10,
           "least standard deviation of a Gaussian, in pixels of the view that resolves it best; 0 "
           "= none");
  t.number("scale-min", o.scale_min, 0, kMostScaleMin,
           "least standard deviation after every step, times the scene extent; 0 = none");
  t.number("scale-max", o.scale_max, 0, kHuge,
           "greatest standard deviation after every step, times the scene extent; 0 = none");
  t.number("opacity-reset-every", o.opacity_reset_every, 0, kMaxCount,
           "opacities are lowered to opacity-reset-value every so many iterations until "
           "densify-until; 0 = never");
  t.number("opacity-reset-value", o.opacity_reset_value, 1e-4, 0.9999, "opacity after a reset");
}

void add_report_options(TrainTable& t, TrainOptions& o) {
  t.section("Reports and files");
  t.number("validate-every", o.validate_every, 0, kMaxCount,
           "iterations between checks of the model, its optimiser, boxes and tree; the first fault "
           "stops the run; 0 = none");
  t.number("log-every", o.log_every, 1, kMaxCount,
           "iterations between rows of metrics.csv and the progress line");
  t.number("eval-every", o.eval_every, 0, kMaxCount,
           "iterations between evaluations of the test views; 0 = none");
  t.shares("eval-at", o.eval_at,
           "further shares of the run, or iterations, to evaluate at; the last one always is");
  t.number("eval-views", o.eval_views, 0, 1e9,
           "test views of an evaluation before the last; 0 = all");
  t.number(
      "eval-renders", o.eval_renders, 0, 1e9,
      "test views written as pictures beside the photo per evaluation: worst, median and best, "
      "then the first ones");
  t.shares("save-at", o.save_at,
           "shares of the run, or iterations, at which the PLY is written; after the last one it "
           "always is");
  t.number("checkpoint-every", o.checkpoint_every, 0, kMaxCount,
           "iterations between checkpoints; 0 = only the last");
  t.number("keep-checkpoints", o.keep_checkpoints, 1, 1e9, "checkpoints kept in the run folder");
}

}  // namespace

std::vector<OptionRow> train_option_rows(TrainOptions& o) {
  TrainTable t;
  add_run_options(t, o);
  add_data_options(t, o);
  add_start_options(t, o);
  add_model_options(t, o);
  add_loss_options(t, o);
  add_optimiser_options(t, o);
  t.section("Ray tracing");
  add_trace_options(t, o.trace);
  add_density_options(t, o);
  add_report_options(t, o);
  return t.take();
}

void check_train_options(TrainOptions options) { check_values(train_option_rows(options)); }

const std::vector<RetiredKey>& retired_train_keys() {
  static const std::string fitted = "the affine colours of photos are fitted, see exposure-damping";
  static const std::vector<RetiredKey> keys{{"exposure-lr", fitted}, {"exposure-lr-final", fitted}};
  return keys;
}

bool take_retired_key(const std::string& name) {
  const std::vector<RetiredKey>& keys = retired_train_keys();
  const auto key = std::ranges::find(keys, name, &RetiredKey::name);
  if (key == keys.end()) return false;
  spdlog::warn("'{}' has no effect any more: {}", key->name, key->instead);
  return true;
}

}  // namespace raysplats
