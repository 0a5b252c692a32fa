// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

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
  /// In a run of so many iterations; at least 1 unless the value is 0.
  std::int64_t of(std::int64_t iterations) const;
  bool operator==(const RunShare&) const = default;
};

/// Photos are reduced by `divisor` until `until`.
struct ResolutionStep {
  int divisor = 1;
  RunShare until;
  bool operator==(const ResolutionStep&) const = default;
};

/// An axis-aligned box, world units; every `high` lies above its `low`.
struct Bounds {
  std::array<double, 3> low{};
  std::array<double, 3> high{};
  bool contains(float x, float y, float z) const {
    return x >= low[0] && x <= high[0] && y >= low[1] && y <= high[1] && z >= low[2] &&
           z <= high[2];
  }
  bool operator==(const Bounds&) const = default;
};

/// In place of a number that has a default by the length of the run, as in short runs every step
/// has to go farther, or by its start.
inline constexpr double kFitted = -1;

/// In place of a number of iterations that fits the number of training photos.
inline constexpr std::int64_t kFittedLength = -1;

/// Learning rate of one parameter group: `initial` decays exponentially to `final_value`.
struct LearningRate {
  double initial = 0;
  double final_value = 0;
};

/// Everything that decides how a model is trained. The defaults are those of configs/default.toml;
/// every member is a key of the configuration files and an option of `raysplats train` (the name
/// with dashes).
struct TrainOptions {
  // Run
  std::int64_t iterations = kFittedLength;  ///< as run_length()
  /// Where the run ends, though schedules are those of `iterations`; 0: with them.
  std::int64_t end_iteration = 0;
  int views_per_step = 1;  ///< whose gradients are added
  std::uint64_t seed = 42;

  // Data
  DatasetOptions data;
  int validate_views = 0;  ///< training views kept out of the loss until 0.9 of the run
  int patience = 0;        ///< validations in a row without gain that end the run; 0 = off
  /// "auto" (white behind cut-out photos, else the photos' typical colour), "random", "sky" or
  /// "r,g,b".
  std::string background = "auto";
  int sky_degree = 2;  ///< of the light of background "sky" by direction; 0 = one trained colour
  std::int64_t image_budget = 1024;  ///< MiB
  std::vector<ResolutionStep> resolution_schedule{{4, 0.1}, {3, 0.18}, {2, 0.4}};
  std::vector<std::string> mirrors;  ///< mesh files of known mirrors
  int mirror_bounces = 4;            ///< mirrors that a ray may meet

  // Start
  std::string init = "auto";      ///< "auto", "colmap", "random" or the path of a PLY
  std::int64_t init_count = 0;    ///< 0 = a share of max_gaussians
  bool photo_points = true;       ///< "auto" may put points of the photos beside sparse ones
  double init_opacity = kFitted;  ///< as start_opacity()
  std::optional<Bounds> bounds;   ///< where Gaussians may be

  // Model
  int sh_degree = 3;
  RunShare sh_degree_interval = 0.1;
  ScaleActivation scale_activation = ScaleActivation::kExp;
  bool flat = false;  ///< the shortest axis shrinks to a hundredth of the next one

  // Loss
  PixelLoss pixel_loss = PixelLoss::kL1;
  double ssim_weight = 0.2;
  bool exposure = false;           ///< an affine colour per training photo is trained too
  double exposure_damping = 0.02;  ///< of its change at a visit of the photo
  double depth_weight = 0;         ///< of the relative error of depth in the loss; 0 = off
  double depth_unit = 1e-3;        ///< world units of a number in depth maps
  bool poses = false;              ///< the poses of the training photos are trained too

  // Optimiser
  LearningRate position_lr{kFitted, kFitted};  ///< times motion_extent(); as position_rate()
  LearningRate rotation_lr{3e-3, kFitted};
  LearningRate scale_lr{kFitted, kFitted};
  LearningRate opacity_lr{1e-1, kFitted};
  LearningRate sh_lr{1e-2, kFitted};  ///< this and the next two: times color_share()
  LearningRate sh_rest_lr{kFitted, kFitted};
  LearningRate sky_lr{1e-2, 1e-3};
  double color_range = 0;            ///< of the photos, as color_range(); 0 = measured
  LearningRate pose_lr{5e-3, 5e-4};  ///< radians, and shares of the scene extent
  double lr_decay = 0.0;  ///< per iteration; 0 reaches the final values in the last iteration
  bool scale_lr_by_extent = false;
  double adam_beta1 = 0.9;
  double adam_beta2 = 0.999;
  double adam_epsilon = 1e-15;
  bool sparse_adam = false;
  bool raise_clamped = true;     ///< as TraceOptions::raise_clamped, which is not read
  RunShare average_from = 0.85;  ///< the model is the mean of the parameters from here on; 0 = off

  // Ray tracing
  /// As standard viewers blend. Its background is not read: `background` above says it.
  TraceOptions trace = peak_order();

  // Density control
  DensityStrategy strategy = DensityStrategy::kBudget;
  RunShare densify_from = 0.04;
  RunShare densify_until = 0.65;
  RunShare densify_every = 0;  ///< 0 = fit to the run and the number of photos
  RunShare replace_until = 0.85;
  double densify_grad_threshold = 4e-4;
  DensifySignal densify_signal = DensifySignal::kAuto;
  double densify_size = 0.01;  ///< times the scene extent
  SizeMeasure densify_measure = SizeMeasure::kLongest;
  double split_factor = 1.6;
  bool densify_inherit = false;  ///< new Gaussians keep their parent's optimiser state
  double prune_opacity = 0.005;
  double prune_scale = 0.0;        ///< times the scene extent; 0 = off
  double prune_scale_min = 0.0;    ///< times the scene extent; 0 = off
  std::int64_t max_gaussians = 0;  ///< 0 = from photos, iterations and device memory
  double opacity_decay = kFitted;  ///< taken off every opacity in each pass; as pass_decay()
  double opacity_reg = 0.01;       ///< weight of the mean opacity in the loss of kMcmc
  double scale_reg = 0.01;         ///< weight of the mean size over the extent in the loss of kMcmc
  double mcmc_noise = 80.0;        ///< strength of the noise on faint Gaussians' means with kMcmc
  double footprint = 0.3;          ///< least standard deviation in pixels; 0 = off
  double scale_min = 0.0;          ///< least standard deviation, times the scene extent; 0 = off
  double scale_max = 0.0;          ///< greatest standard deviation, likewise; 0 = off
  std::int64_t opacity_reset_every = 0;
  double opacity_reset_value = 0.01;

  // Reports and files
  std::int64_t log_every = 10;
  std::int64_t validate_every = 0;
  std::int64_t eval_every = 0;
  std::vector<RunShare> eval_at{0.1, 0.3, 0.7};
  int eval_views = 0;  ///< 0 = all
  int eval_renders = 4;
  std::vector<RunShare> save_at{0.7};
  std::int64_t checkpoint_every = 1000;
  int keep_checkpoints = 2;
};

}  // namespace raysplats
