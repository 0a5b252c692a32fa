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

}  // namespace

Camera Pace::sized(const Camera& camera) const {
  const double own = static_cast<double>(camera.width) * camera.height;
  const double factor = std::sqrt(own / pixels_);
  const double most = std::max(1.0, camera.height / kLeastHeight);
  return factor <= 1.0 ? camera : downscaled(camera, std::min(factor, most));
}

void Pace::record(double pixels, double seconds) {
  const double wanted = pixels * seconds_ / std::max(seconds, 1e-4);
  const double change = std::clamp(wanted / pixels_, 1.0 / kMostChange, kMostChange);
  if (change < kTolerance && change > 1.0 / kTolerance) return;
  pixels_ *= change;
}

}  // namespace raysplats::view
