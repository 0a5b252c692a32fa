// SPDX-License-Identifier: Apache-2.0
#include "view/pace.hpp"

#include <algorithm>
#include <cmath>

namespace raysplats::view {
namespace {

constexpr double kLeastHeight = 48.0;
/// One slow picture (another program, a look at everything at once) is not to shrink the next one
/// to nothing, nor a quick one to let it grow beyond what can be told.
constexpr double kMostChange = 1.6;
/// Differences that are left alone: sizes that flicker look worse than ones that are a bit off.
constexpr double kTolerance = 1.15;
/// Weight of a picture, as a share of that of the next one.
constexpr double kMemory = 0.85;
/// How much sizes have to vary, as a share of their mean, to tell what any picture takes.
constexpr double kSpread = 0.1;
/// What any picture takes, at most, as a share of its time; more than that is noise.
constexpr double kMostFixed = 0.8;
/// What the pixels have of the time at least, as a share.
constexpr double kLeastShare = 0.5;

}  // namespace

Camera Pace::sized(const Camera& camera) const {
  const double own = static_cast<double>(camera.width) * camera.height;
  const double factor = std::sqrt(own / pixels_);
  const double most = std::max(1.0, camera.height / kLeastHeight);
  return factor <= 1.0 ? camera : downscaled(camera, std::min(factor, most));
}

void Pace::record(double pixels, double seconds) {
  for (double* sum : {&number_, &sum_pixels_, &sum_squares_, &sum_seconds_, &sum_products_})
    *sum *= kMemory;
  number_ += 1;
  sum_pixels_ += pixels;
  sum_squares_ += pixels * pixels;
  sum_seconds_ += seconds;
  sum_products_ += pixels * seconds;
  const double mean = sum_pixels_ / number_;
  const double mean_seconds = std::max(sum_seconds_ / number_, 1e-4);
  const double variance = sum_squares_ / number_ - mean * mean;
  if (variance > kSpread * kSpread * mean * mean) {  // least squares
    const double slope = (sum_products_ / number_ - mean * mean_seconds) / variance;
    fixed_ = std::max(mean_seconds - slope * mean, 0.0);
  }
  fixed_ = std::min(fixed_, kMostFixed * mean_seconds);
  const double room = std::max(seconds_ - fixed_, kLeastShare * seconds_);
  const double wanted = mean * room / (mean_seconds - fixed_);
  const double change = std::clamp(wanted / pixels_, 1.0 / kMostChange, kMostChange);
  if (change < kTolerance && change > 1.0 / kTolerance) return;
  pixels_ *= change;
}

}  // namespace raysplats::view
