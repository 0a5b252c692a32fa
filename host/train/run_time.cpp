// SPDX-License-Identifier: Apache-2.0
#include "train/run_time.hpp"

#include <algorithm>
#include <utility>
#include <vector>

#include "core/statistics.hpp"
#include "raysplats/error.hpp"
#include "train/schedule.hpp"

namespace raysplats {
namespace {

// Of a pixel and of a hit beside that of a Gaussian.
constexpr double kPixelWork = 0.58;
constexpr double kHitWork = 0.016;
constexpr double kLeastHits = 48.0;    // of a trained model, per pixel that shows something
constexpr double kHitGrowth = 1.15;    // from the first steps at full size to the end
constexpr double kLarge = 0.5;         // of the largest view: steps that tell the speed
constexpr std::int64_t kSlices = 400;  // of a run, when its steps are added up
constexpr std::int64_t kMostIterations = 10'000'000;

// From when on photos have their full size, as a share of the run.
double full_size_from(const TrainOptions& options) {
  double share = 0.0;
  for (const ResolutionStep& step : options.resolution_schedule) {
    const auto until = static_cast<double>(step.until.of(options.iterations));
    share =
        std::max(share, until / static_cast<double>(std::max<std::int64_t>(options.iterations, 1)));
  }
  return std::min(share, 1.0);
}

}  // namespace

double step_work(double pixels, double gaussians, double hits) {
  return gaussians + kPixelWork * pixels + kHitWork * hits;
}

double seconds_per_work(std::span<const StepSample> samples) {
  double most = 0;
  for (const StepSample& s : samples) most = std::max(most, s.seconds > 0 ? s.pixels : 0.0);
  std::vector<double> speeds;
  for (const StepSample& s : samples) {
    if (s.seconds > 0 && s.pixels >= kLarge * most)
      speeds.push_back(s.seconds / step_work(s.pixels, s.gaussians, s.hits));
  }
  if (speeds.empty()) throw UsageError("No step was timed: there is nothing to estimate from");
  const double half = 0.5;
  return quantiles(std::move(speeds), std::span<const double>(&half, 1))[0];
}

HitCurve expected_hits(double at_start, double at_full_size, double opaque_share) {
  return {at_start, std::max(kHitGrowth * at_full_size, kLeastHits * opaque_share)};
}

double expected_gaussians(const TrainOptions& options,
                          std::int64_t iteration,
                          double first,
                          double limit) {
  const auto from = static_cast<double>(options.densify_from.of(options.iterations));
  const auto until = static_cast<double>(options.densify_until.of(options.iterations));
  if (until <= from || limit <= first) return first;
  const double x = std::clamp((static_cast<double>(iteration) - from) / (until - from), 0.0, 1.0);
  return limit - (limit - first) * (1.0 - x) * (1.0 - x);
}

double run_work(
    const TrainOptions& options, double pixels, const HitCurve& hits, double first, double limit) {
  const std::int64_t slices = std::min(kSlices, options.iterations);
  const double full = full_size_from(options);
  double sum = 0;
  for (std::int64_t k = 0; k < slices; ++k) {
    const std::int64_t begin = k * options.iterations / slices;
    const std::int64_t end = (k + 1) * options.iterations / slices;
    const std::int64_t middle = (begin + end) / 2;
    const double share = static_cast<double>(middle) / static_cast<double>(options.iterations);
    const double risen = full > 0 ? std::min(share / full, 1.0) : 1.0;
    const double divisor = resolution_divisor(options, middle);
    const double rays = pixels / (divisor * divisor);
    sum += static_cast<double>(end - begin) *
           step_work(rays, expected_gaussians(options, middle, first, limit),
                     rays * (hits.first + (hits.last - hits.first) * risen));
  }
  return sum;
}

std::int64_t iterations_within(double seconds,
                               std::int64_t least,
                               const std::function<double(std::int64_t)>& seconds_of) {
  std::int64_t low = least, high = kMostIterations;
  while (low < high) {
    const std::int64_t middle = low + (high - low + 1) / 2;
    if (seconds_of(middle) <= seconds) {
      low = middle;
    } else {
      high = middle - 1;
    }
  }
  return low;
}

}  // namespace raysplats
