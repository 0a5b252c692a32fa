// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "device/context.hpp"
#include "raysplats/train_options.hpp"
#include "trace/device_gaussians.hpp"
#include "train/density/density_plan.hpp"
#include "train/density/relocation.hpp"

namespace raysplats {

/// Adaptive density control (Kerbl et al. 2023, section 5): sums the screen-space gradient of every
/// Gaussian on the device, and from time to time clones, splits and removes Gaussians. Everything
/// random depends on the seed, the iteration and the Gaussian's index alone.
class DensityControl {
 public:
  /// `extent` is the scene extent that the relative sizes of the options refer to, `views` the
  /// number of training views, which steps show in passes over all of them.
  DensityControl(Context& context, const TrainOptions& options, double extent, std::size_t views);

  /// Goes on by other options, as if made with them: the length of a run may be fixed late.
  void follow(const TrainOptions& options, std::size_t views);

  /// The count that max-gaussians = 0 stands for.
  void set_limit(std::size_t limit) { limit_ = limit; }
  std::size_t limit() const { return limit_; }

  /// Adds the statistics of one view, or of several whose gradients are added; enqueues without
  /// waiting. A `guard` whose first word is not 0 keeps them as they are.
  void accumulate(const DeviceGaussians& gaussians,
                  const GaussianGradients& gradients,
                  const Buffer<std::uint32_t>* guard = nullptr);

  /// Whether `signal = step` wants the step after so many iterations measured: then begin_step()
  /// comes before the optimiser's step, end_step() behind it. They enqueue without waiting; a guard
  /// whose first word is not 0 measures nothing.
  bool measures_step(std::int64_t iteration) const;
  void begin_step(const DeviceGaussians& gaussians);
  void end_step(const DeviceGaussians& gaussians, const Buffer<std::uint32_t>& guard);

  /// Whether the statistics of a step are of use.
  bool accumulates_at(std::int64_t iteration) const { return iteration < last_; }

  /// Whether refine() is due after `iteration` (counted from 1), or resetting the opacities is.
  bool refines_at(std::int64_t iteration) const;
  bool resets_at(std::int64_t iteration) const;

  /// Whether a pass would be due if passes had not ended: what follows them goes on until the end.
  bool idles_at(std::int64_t iteration) const;

  /// Whether the model is another one after a pass that is due after `iteration`, and whether
  /// anything is due then.
  bool changes_at(std::int64_t iteration) const {
    return refines_at(iteration) || resets_at(iteration);
  }
  bool acts_at(std::int64_t iteration) const {
    return changes_at(iteration) || idles_at(iteration);
  }

  /// Replaces `gaussians` by the new set and starts new statistics. The returned plan says where
  /// each new Gaussian comes from, for whoever keeps state per Gaussian. Throws RuntimeError-coded
  /// Error when no Gaussian is left.
  DensityPlan refine(DeviceGaussians& gaussians, std::int64_t iteration);

  /// Splits Gaussians, none twice and without regard to the statistics, until there are `most`.
  DensityPlan split_evenly(DeviceGaussians& gaussians, std::size_t most);

  /// Lowers opacities to opacity-reset-value.
  void reset_opacities(DeviceGaussians& gaussians);

  /// kDensityStatistics numbers per Gaussian, for checkpoints. Empty before the first
  /// accumulate().
  const Buffer<float>& statistics() const { return statistics_; }
  void restore_statistics(std::span<const float> statistics);

 private:
  DensityPlan plan(const DeviceGaussians& gaussians, std::int64_t iteration) const;
  RelocationPlan plan_moves(const DeviceGaussians& gaussians, std::int64_t iteration) const;
  std::size_t target(std::size_t count, std::int64_t iteration) const;
  void fade_opacities(DeviceGaussians& gaussians);
  void gather(DeviceGaussians& gaussians, const DensityPlan& plan, std::int64_t iteration);

  Context& context_;
  TrainOptions options_;
  double extent_;
  std::size_t limit_ = 0;
  std::int64_t first_ = 0, growth_end_ = 0, last_ = 0, period_ = 0;  // iterations
  bool whole_passes_ = false;                                        // a period sees every view
  double decay_ = 0;  // of opacities, as pass_decay()
  Buffer<float> statistics_;
  Buffer<float> old_means_;  // before a step that is measured
  Buffer<std::uint32_t> open_guard_;
};

}  // namespace raysplats
