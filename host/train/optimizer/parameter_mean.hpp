// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "device/context.hpp"
#include "raysplats/train_options.hpp"
#include "trace/device_gaussians.hpp"

namespace raysplats {

/// The mean of the parameters over the last steps of a run, mean_from() on, which is the model that
/// the run ends with: see cl/train/parameter_mean.cl. Training goes on from the parameters
/// themselves and never sees it.
class ParameterMean {
 public:
  /// More samples than this are not taken: in long runs steps between them are left out, so that
  /// what one sample moves the mean by is not lost in the rounding of single precision.
  static constexpr std::int64_t kMostSamples = 256;

  explicit ParameterMean(Context& context) : context_(context) {}

  /// Takes the parameters after the run's step `iteration`, counted from 1, where that is a sample,
  /// and says whether it is; enqueues without waiting. A guard whose first word is not 0 keeps the
  /// mean as it is. A step may be told again, as the next one.
  bool add(const TrainOptions& options,
           const DeviceGaussians& gaussians,
           std::int64_t iteration,
           const Buffer<std::uint32_t>& guard);
  /// The set of Gaussians has changed after `iteration` steps: what follows is another mean.
  void restart(std::int64_t iteration);

  /// Whether there is one, of as many Gaussians as in the last sample.
  bool known() const { return mean_.count > 0; }
  /// Where known().
  DeviceGaussians& model() { return mean_; }
  const DeviceGaussians& model() const { return mean_; }

  /// Iterations before the last restart, for checkpoints.
  std::int64_t since() const { return since_; }
  /// Goes on from a checkpoint after `iteration` steps with a mean in the form of `like`, the
  /// groups of which the caller puts into model(), if a run with these options has one by then;
  /// says so.
  bool restore(const TrainOptions& options,
               const DeviceGaussians& like,
               std::int64_t iteration,
               std::int64_t since);

 private:
  std::int64_t first(const TrainOptions& options) const;
  void shape(const DeviceGaussians& like);

  Context& context_;
  DeviceGaussians mean_;
  std::int64_t since_ = 0;
};

}  // namespace raysplats
