// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "raysplats/bounds.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/trace_options.hpp"

namespace raysplats {

/// Pixel term of the training loss.
enum class PixelLoss {
  kL1,  ///< mean absolute error (3DGS)
  kL2,  ///< mean squared error (the paper)
};

/// How the number of Gaussians is controlled.
enum class DensityStrategy {
  kBudget,  ///< a curve up to a count; the Gaussians with the highest signals are split
  kAdc,     ///< whatever exceeds a threshold is cloned or split (Kerbl et al. 2023)
  kMcmc,    ///< what is faint moves to what is not, with noise (Kheradmand et al. 2024)
};

/// Gradient statistic that decides which Gaussians are densified.
enum class DensifySignal {
  kAuto,      ///< kAbsolute with kBudget, kScreen with kAdc
  kScreen,    ///< norm of the summed screen-space gradient (3DGS)
  kAbsolute,  ///< norm of the sum of absolute per-ray gradients (AbsGS, Ye et al. 2024)
  kStep,      ///< the last step of the mean, over the scene extent (RaySplats' authors)
};

/// What the size of a Gaussian means to kAdc.
enum class SizeMeasure {
  kLongest,  ///< its greatest standard deviation
  kNorm,     ///< the root of the sum of the three squares (RaySplats' authors)
};

/// A moment or a span of a run: a value below 1 is a share of its iterations, any other a number of
/// iterations; 0 = none.
struct RunShare {
  double value = 0;

  RunShare() = default;
  /// Implicit, so that options read as numbers.
  RunShare(double share_or_iterations) : value(share_or_iterations) {}
  /// The iteration that it means in a run of so many; at least 1 unless the value is 0.
  std::int64_t of(std::int64_t iterations) const;
  bool operator==(const RunShare&) const = default;
};

/// The size at which photos are trained on for a part of a run.
struct ResolutionStep {
  int divisor = 1;  ///< width and height of the photos are divided by it, at least 1
  RunShare until;   ///< moment at which the next step begins
  bool operator==(const ResolutionStep&) const = default;
};

/// Stands for a number that follows from the length of the run, as in short runs every step has to
/// go farther, or from its start.
inline constexpr double kFitted = -1;

/// Stands for a number of iterations that fits the number of training photos.
inline constexpr std::int64_t kFittedLength = -1;

/// Learning rate of one parameter group: `initial` decays exponentially to `final_value`.
struct LearningRate {
  double initial = 0;      ///< in the first iteration
  double final_value = 0;  ///< what it falls to
};

/// Everything that decides how a model is trained. The defaults are those of configs/default.toml;
/// every member is a key of the configuration files and an option of `raysplats train` (the name
/// with dashes).
struct TrainOptions {
  // Run
  /// Steps of the whole run; kFittedLength: 100 for each training photo, from 1000 to 10000.
  std::int64_t iterations = kFittedLength;
  /// Where the run ends, though schedules are those of `iterations`; 0: with them.
  std::int64_t end_iteration = 0;
  int views_per_step = 1;   ///< views of a step, whose gradients are added
  std::uint64_t seed = 42;  ///< of the order of views, a random start and splits

  // Data
  /// How the data set was read, as a run says for its evaluation; a resumed one has to have the
  /// same. Trainer takes it from what load_dataset() gave.
  DatasetOptions data;
  /// From 0.1 of the run on photos that contradict those from beside them are not trained on
  /// (photos_to_leave_out() of host/eval); not with `poses`, which may mend what is wrong with
  /// them.
  bool leave_out_odd = true;
  /// From 0.2 of the run on what a photo shows and others do not, where they see that place, is not
  /// trained on (moving_areas() of host/eval); not with mirrors.
  bool leave_out_moving = false;
  /// Of photos from one place no more are drawn in a pass than four times as many as most places
  /// have (crowded_places() of host/train).
  bool even_places = true;
  int validate_views = 0;  ///< training views kept out of the loss, by which the run is judged
  int patience = 0;        ///< validations in a row without gain that end the run; 0 = off
  /// "auto" (white behind cut-out photos, else the photos' typical colour), "random", "sky" or
  /// "r,g,b".
  std::string background = "auto";
  int sky_degree = 2;  ///< of the light of background "sky" by direction; 0 = one trained colour
  /// MiB of photos and depth maps kept on the device, and of test photos beside it as far as those
  /// leave room; the others are read again when their turn comes.
  std::int64_t image_budget = 1024;
  /// Coarse sizes, in the order of the run; full size behind the last, and where there are none.
  std::vector<ResolutionStep> resolution_schedule{{4, 0.1}, {3, 0.18}, {2, 0.4}};
  std::vector<std::string> mirrors;  ///< mesh files of known mirrors
  int mirror_bounces = 4;            ///< mirrors that a ray may meet

  // Start
  /// "auto" (sparse points where there are any, else photos), "colmap" (sparse points), "photos",
  /// "random" or the path of a model.
  std::string init = "auto";
  /// Gaussians of a start without points, or beside few; 0 = a share of max_gaussians.
  std::int64_t init_count = 0;
  bool photo_points = true;      ///< "auto" may put points of the photos beside sparse ones
  bool uncovered_points = true;  ///< and where there are no sparse ones, at any depth
  /// Opacity of the first Gaussians, in (0, 1); kFitted: 0.1, or 0.02 of a random start (not
  /// kMcmc).
  double init_opacity = kFitted;
  std::optional<Bounds> bounds;  ///< where the means of Gaussians may be

  // Model
  int sh_degree = 3;                  ///< of the colours, 0 to 4
  RunShare sh_degree_interval = 0.1;  ///< from one band to the next; 0 = all from the start
  ScaleActivation scale_activation = ScaleActivation::kExp;  ///< of the scale parameters
  bool flat = false;  ///< the shortest axis shrinks to a hundredth of the next one

  // Loss
  PixelLoss pixel_loss = PixelLoss::kL1;  ///< pixel term
  double ssim_weight = 0.2;               ///< lambda of (1 - lambda) pixel term + lambda (1 - SSIM)
  double alpha_weight = 0.2;              ///< of the error of coverage, where photos are cut out
  bool exposure = false;                  ///< an affine colour per training photo is trained too
  double exposure_damping = 0.02;         ///< of its change at a visit of the photo
  double depth_weight = 0;                ///< of the relative error of depth in the loss; 0 = off
  double depth_unit = 1e-3;               ///< world units of a number in depth maps
  bool poses = false;                     ///< the poses of the training photos are trained too

  // Optimiser
  // kFitted: by the length of the run, as configs/default.toml says of each.
  /// Rate of the means, times the scene extent (through telephoto lenses at most 2.5 times what
  /// they see across).
  LearningRate position_lr{kFitted, kFitted};
  LearningRate rotation_lr{3e-3, kFitted};    ///< of the quaternions
  LearningRate scale_lr{kFitted, kFitted};    ///< of the scale parameters
  LearningRate opacity_lr{1e-1, kFitted};     ///< of the logits of opacities
  LearningRate sh_lr{1e-2, kFitted};          ///< of colour (SH band 0)
  LearningRate sh_rest_lr{kFitted, kFitted};  ///< of the SH bands above 0
  LearningRate sky_lr{1e-2, 1e-3};            ///< of the sky's coefficients
  /// Range of the photos' colours, from the 1st to the 99th percentile of a channel; below 0.8
  /// sh_lr, sh_rest_lr and sky_lr are as much smaller as it is. 0 = measured.
  double color_range = 0;
  LearningRate pose_lr{5e-3, 5e-4};  ///< radians, and shares of the scene extent
  double lr_decay = 0.0;  ///< per iteration; 0 reaches the final values in the last iteration
  bool scale_lr_by_extent = false;  ///< scale_lr is times the scene extent (RaySplats' authors)
  double adam_beta1 = 0.9;          ///< decay of the first moment
  double adam_beta2 = 0.999;        ///< decay of the second moment
  double adam_epsilon = 1e-15;      ///< added to the root of the second moment
  bool sparse_adam = false;         ///< Gaussians that no ray of the view met stay as they are
  bool raise_clamped = true;        ///< as TraceOptions::raise_clamped, which is not read
  RunShare average_from = 0.85;  ///< the model is the mean of the parameters from here on; 0 = off

  // Ray tracing
  /// As standard viewers blend. Its background is not read: `background` above says it.
  TraceOptions trace = peak_order();

  // Density control
  DensityStrategy strategy = DensityStrategy::kBudget;  ///< see there
  RunShare densify_from = 0.04;   ///< first iteration that may add or remove Gaussians
  RunShare densify_until = 0.65;  ///< last one that may add some; 0 = no density control
  RunShare densify_every = 0;  ///< from pass to pass; 0 = fit to the run and the number of photos
  /// Until then passes of kBudget and kMcmc go on without growth: what they remove is replaced.
  RunShare replace_until = 0.85;
  double densify_grad_threshold = 4e-4;  ///< mean signal above which kAdc clones or splits
  DensifySignal densify_signal = DensifySignal::kAuto;  ///< what kBudget and kAdc go by
  double densify_size = 0.01;  ///< kAdc splits larger ones, clones others; times the scene extent
  /// What densify_size, prune_scale and prune_scale_min compare.
  SizeMeasure densify_measure = SizeMeasure::kLongest;
  double split_factor = 1.6;       ///< children of a split by kAdc are smaller by it
  bool densify_inherit = false;    ///< new Gaussians keep their parent's optimiser state
  double prune_opacity = 0.005;    ///< fainter Gaussians are removed, or moved by kMcmc
  double prune_scale = 0.0;        ///< kAdc removes larger ones; times the scene extent; 0 = off
  double prune_scale_min = 0.0;    ///< kAdc removes smaller ones; likewise
  std::int64_t max_gaussians = 0;  ///< most Gaussians; 0 = by photos, iterations and memory
  double prune_weight = 0.001;     ///< kBudget removes what the rays that meet it blend less of, on
                                   ///< average; 0 = off
  double opacity_decay = kFitted;  ///< taken off every opacity in each pass; as pass_decay()
  double opacity_reg = 0.01;       ///< weight of the mean opacity in the loss of kMcmc
  double scale_reg = 0.01;         ///< weight of the mean relative size in the loss of kMcmc
  double mcmc_noise = 80.0;        ///< strength of the noise on faint Gaussians' means with kMcmc
  double footprint = 0.3;          ///< least standard deviation in pixels; 0 = off
  double scale_min = 0.0;          ///< least standard deviation, times the scene extent; 0 = off
  double scale_max = 0.0;          ///< greatest standard deviation, likewise; 0 = off
  /// Iterations from one lowering of all opacities to the next, until densify_until; 0 = never.
  std::int64_t opacity_reset_every = 0;
  double opacity_reset_value = 0.01;  ///< greatest opacity after it

  // Reports and files
  std::int64_t log_every = 10;  ///< iterations between rows of metrics.csv and the progress line
  std::int64_t validate_every = 0;  ///< iterations between checks of model and tree; 0 = none
  std::int64_t eval_every = 0;      ///< iterations between evaluations of test views; 0 = none
  std::vector<RunShare> eval_at{0.1, 0.3, 0.7};  ///< further evaluations; the last model has one
  int eval_views = 0;                    ///< test views of an evaluation before the last; 0 = all
  int eval_renders = 4;                  ///< test views written as pictures per evaluation
  std::vector<RunShare> save_at{0.7};    ///< when the PLY is written; after the last one it is too
  std::int64_t checkpoint_every = 1000;  ///< iterations between checkpoints; 0 = only the last
  int keep_checkpoints = 2;              ///< checkpoints kept in the run folder, at least 1
};

}  // namespace raysplats
