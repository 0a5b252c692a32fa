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
  double hits = 0;       ///< blended (ray, Gaussian) pairs; 0 where they are not counted
  double seconds = 0;
};

/// What a step costs, in units of what one Gaussian of the model does: each Gaussian is moved by
/// Adam and put into lists, each pixel has a loss, each hit is blended and has a gradient. The
/// ratios are those of nine captures on two CPU cores (docs/training.md).
double step_work(double pixels, double gaussians, double hits);

/// Seconds of a unit of work: the median of the steps that have the most pixels, so that a step
/// that had to wait (a photo was decoded, a buffer grew) counts no more than any other. Throws
/// UsageError without samples.
double seconds_per_work(std::span<const StepSample> samples);

/// Hits per pixel in a run: they rise evenly from the first steps until the photos have their full
/// size, and stay.
struct HitCurve {
  double first = 0, last = 0;
};

/// The curve from a run's first steps, and from steps at full size with the Gaussians of its end,
/// both per pixel. A start that leaves the rays much light fills up: few trained models have less
/// than about 48 hits per pixel that shows something, `opaque_share` of all.
HitCurve expected_hits(double at_start, double at_full_size, double opaque_share);

/// The Gaussians of a run after `iteration` steps, on the curve of the budget strategy from `first`
/// at its start to `limit`.
double expected_gaussians(const TrainOptions& options,
                          std::int64_t iteration,
                          double first,
                          double limit);

/// Work of all steps of a run with these options. `pixels` is the mean of the training views at
/// full size, `first` and `limit` are its Gaussians at the start and the most that it may have.
double run_work(
    const TrainOptions& options, double pixels, const HitCurve& hits, double first, double limit);

/// The most iterations, from `least` on, whose run takes no more than `seconds`;
/// `seconds_of(iterations)` must not fall.
std::int64_t iterations_within(double seconds,
                               std::int64_t least,
                               const std::function<double(std::int64_t)>& seconds_of);

}  // namespace raysplats
