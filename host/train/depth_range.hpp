// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

namespace raysplats {

/// Where a sweep looks, as distances from the cameras.
struct DepthRange {
  double nearest = 0;
  double typical = 0;  ///< of what most cameras look at
  double farthest = 0;
  bool open = false;  ///< the photos are too near to each other to tell any depth

  /// The distance at that share of the way through the range, evenly by the logarithm.
  double at(double share) const { return nearest * std::pow(farthest / nearest, share); }
};

}  // namespace raysplats
