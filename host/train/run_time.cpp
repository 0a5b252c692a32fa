// SPDX-License-Identifier: Apache-2.0
#include "train/run_time.hpp"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "raysplats/error.hpp"
#include "raysplats/gaussians.hpp"
#include "scene/statistics.hpp"
#include "train/schedule.hpp"

namespace raysplats {
namespace {

// Work, where that of a Gaussian is 1.
constexpr double kBasisWork = 0.037;  // of one of its spherical harmonics
constexpr double kPixelWork = 0.13;
constexpr double kHitWork = 0.0244;
constexpr double kCandidateWork = 1.25;
constexpr double kUsualHits = 80.0;        // of a trained model, per pixel
constexpr double kUsualBodyHits = 52.0;    // of one that is cut out, per pixel that shows it
constexpr double kCandidateGrowth = 1.15;  // from Gaussians split evenly to those of the end
// Steps of trained models take longer than timed ones that do as much (long thin Gaussians are
// candidates of more rays that miss them), and there is density control between them.
constexpr double kBeyond = 1.1;
constexpr double kLarge = 0.5;         // of the largest view: steps that tell the speed
constexpr std::int64_t kSlices = 400;  // of a run, when its steps are added up
constexpr std::int64_t kMostIterations = 10'000'000;
constexpr double kLatestEnd = 2;  // of the iterations that were planned
constexpr double kGrace = 0.07;   // of the time that a slow run takes on for its last steps

// When photos begin to have their full size, as a share of the run.
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

double step_work(const StepLoad& load) {
  return load.gaussians * (1.0 + kBasisWork * load.bases) + kPixelWork * load.pixels +
         kHitWork * load.hits + kCandidateWork * load.candidates;
}

double seconds_per_work(std::span<const StepSample> samples) {
  double most = 0;
  for (const StepSample& s : samples) most = std::max(most, s.seconds > 0 ? s.load.pixels : 0.0);
  std::vector<double> speeds;
  for (const StepSample& s : samples) {
    if (s.seconds > 0 && s.load.pixels >= kLarge * most)
      speeds.push_back(s.seconds / step_work(s.load));
  }
  if (speeds.empty()) throw UsageError("No step was timed: there is nothing to estimate from");
  return median(std::move(speeds));
}

LoadRates LoadRates::of(std::span<const StepSample> samples) {
  StepLoad sum;
  for (const StepSample& s : samples) {
    sum.pixels += s.load.pixels, sum.gaussians += s.load.gaussians;
    sum.hits += s.load.hits, sum.candidates += s.load.candidates;
  }
  if (!(sum.pixels > 0) || !(sum.gaussians > 0)) return {};
  return {sum.hits / sum.pixels, sum.candidates / sum.gaussians};
}

double trained_hits(double hits, std::optional<double> body_share) {
  const double usual = body_share ? kUsualBodyHits * *body_share : kUsualHits;
  if (hits > usual) return std::sqrt(usual * hits);
  return hits > 0 ? usual : 0;
}

RateCurve expected_rates(const LoadRates& at_start, const LoadRates& alike, double hits) {
  return {at_start, {hits, kCandidateGrowth * alike.candidates}};
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

double run_work(const TrainOptions& options,
                double pixels,
                const RateCurve& rates,
                double first,
                double limit) {
  const auto between = [](double begin, double end, double x) { return begin + (end - begin) * x; };
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
    const double gaussians = expected_gaussians(options, middle, first, limit);
    const int bases = sh_coefficients(active_sh_degree(options, middle));
    sum += static_cast<double>(end - begin) *
           step_work({rays, gaussians, static_cast<double>(bases),
                      rays * between(rates.first.hits, rates.last.hits, risen),
                      gaussians * between(rates.first.candidates, rates.last.candidates, risen)});
  }
  return kBeyond * sum;
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

std::int64_t fitted_end(const SteadyPace& pace, std::int64_t planned, double run_seconds) {
  const auto now = static_cast<double>(pace.iteration);
  const auto all = static_cast<double>(planned);
  const double least = std::min(pace.seconds_of_step * (all - now), kGrace * run_seconds);
  const double more = std::max(run_seconds - pace.seconds, least) / pace.seconds_of_step;
  return static_cast<std::int64_t>(std::clamp(now + more, now + 1, kLatestEnd * all));
}

}  // namespace raysplats
