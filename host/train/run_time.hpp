// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>

#include "raysplats/train_options.hpp"

namespace raysplats {

/// What a step of training has to do.
struct StepLoad {
  double pixels = 0;      ///< rays of the view
  double gaussians = 0;   ///< of the model
  double bases = 0;       ///< spherical harmonics of a Gaussian: 16 at degree 3
  double hits = 0;        ///< blended (ray, Gaussian) pairs; 0 where they are not counted
  double candidates = 0;  ///< (tile, Gaussian) pairs that the rays of the tiles are tested against
};

/// A step that was timed.
struct StepSample {
  StepLoad load;
  double seconds = 0;  ///< 0 of one that was made again, whose time tells nothing
};

/// What a step costs, in units of what one Gaussian of the model does: each Gaussian is moved by
/// Adam and put into lists, each of its spherical harmonics too, each pixel has a loss, each
/// candidate is tested by the rays of its tile and has a gradient, each hit is blended. The ratios
/// are those of twelve captures on two CPU cores (docs/training.md).
double step_work(const StepLoad& load);

/// Seconds of a unit of work: the median of the steps that have the most pixels, so that a step
/// that had to wait (a photo was decoded, a buffer grew) counts no more than any other. A device is
/// slower where a model outgrows its caches: the steps are those of one count of Gaussians, the one
/// that counts. Throws UsageError without samples.
double seconds_per_work(std::span<const StepSample> samples);

/// What the rays of a view meet.
struct LoadRates {
  double hits = 0;        ///< per pixel
  double candidates = 0;  ///< per Gaussian of the model

  /// The rates of timed steps together.
  static LoadRates of(std::span<const StepSample> samples);
};

/// Rates in a run: they rise evenly from the first steps until the photos have their full size,
/// and stay.
struct RateCurve {
  LoadRates first, last;
};

/// Hits per pixel of a trained model, of which the start has as many as are given. A start that
/// leaves the rays much light fills up, one that leaves them little clears: most trained models
/// have about 80, those of bodies that are cut out 52 where they are, `body_share` of all pixels.
/// Rays that count no hits, those traced one by one, have none at the end either.
double trained_hits(double hits, std::optional<double> body_share);

/// The curve from a run's first steps to as many hits per pixel, where steps with the Gaussians of
/// its end and rays that meet about as many have the rates `alike`.
RateCurve expected_rates(const LoadRates& at_start, const LoadRates& alike, double hits);

/// The Gaussians of a run after `iteration` steps, on the curve of the budget strategy from `first`
/// at its start to `limit`.
double expected_gaussians(const TrainOptions& options,
                          std::int64_t iteration,
                          double first,
                          double limit);

/// Work of all steps of a run with these options. `pixels` is the mean of the training views at
/// full size, `first` and `limit` are its Gaussians at the start and the most that it may have.
double run_work(
    const TrainOptions& options, double pixels, const RateCurve& rates, double first, double limit);

/// The most iterations, from `least` on, whose run takes no more than `seconds`;
/// `seconds_of(iterations)` must not fall.
std::int64_t iterations_within(double seconds,
                               std::int64_t least,
                               const std::function<double(std::int64_t)>& seconds_of);

/// How far a run of a given time is when its last steps, which are alike, have been timed.
struct SteadyPace {
  std::int64_t iteration = 0;  ///< of the run, so far
  double seconds = 0;          ///< spent so far
  double seconds_of_step = 0;  ///< from here on
};

/// The iteration that a run which was planned with `planned` iterations ends with, so that it
/// takes `run_seconds`: at most twice as many as planned. A run that is slower than planned makes
/// as many further steps of the planned ones as 0.07 of its time has room for, even where none is
/// left: its model is the mean of its last steps.
std::int64_t fitted_end(const SteadyPace& pace, std::int64_t planned, double run_seconds);

}  // namespace raysplats
