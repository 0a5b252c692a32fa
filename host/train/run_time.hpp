// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>

#include "raysplats/train_options.hpp"

namespace raysplats {

/// A step of training that was timed.
struct StepSample {
  double pixels = 0;     ///< rays of the view
  double gaussians = 0;  ///< of the model
  double seconds = 0;
};

/// Seconds of a step as fixed + per_pixel * pixels + per_gaussian * Gaussians, none of them
/// negative.
struct StepCost {
  double fixed = 0, per_pixel = 0, per_gaussian = 0;
  double seconds(double pixels, double gaussians) const {
    return fixed + per_pixel * pixels + per_gaussian * gaussians;
  }
};

/// Least squares of the relative errors; samples that take more than three times what the others
/// make of them (a photo was decoded, a buffer grew) are left out in a second round. Throws
/// UsageError without samples.
StepCost fit_step_cost(std::span<const StepSample> samples);

/// The Gaussians of a run after `iteration` steps, on the curve of the budget strategy from `first`
/// at its start to `limit`.
double expected_gaussians(const TrainOptions& options,
                          std::int64_t iteration,
                          double first,
                          double limit);

/// Seconds of all steps of a run with these options. `pixels` is the mean of the training views at
/// full size.
double run_seconds(
    const TrainOptions& options, const StepCost& cost, double pixels, double first, double limit);

/// The most iterations, from `least` on, whose run takes no more than `seconds`;
/// `seconds_of(iterations)` must not fall.
std::int64_t iterations_within(double seconds,
                               std::int64_t least,
                               const std::function<double(std::int64_t)>& seconds_of);

}  // namespace raysplats
