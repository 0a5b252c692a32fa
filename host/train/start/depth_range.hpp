// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstddef>

namespace raysplats {

/// What pixels show that tell no depth, as of skies and white walls, may be anywhere from the
/// typical distance to a thousand times that, where the sky no longer moves with the cameras: the
/// distance at that share of the way, evenly by the logarithm.
inline double unknown_depth(double typical, double share) {
  return typical * std::pow(1000.0, share);
}

/// Where a sweep looks, as distances from the cameras.
struct DepthRange {
  double nearest = 0;
  double typical = 0;  ///< of what most cameras look at
  double farthest = 0;
  bool open = false;  ///< the photos are too near to each other to tell any depth

  /// The distance at that share of the way through the range, evenly by the logarithm.
  double at(double share) const { return nearest * std::pow(farthest / nearest, share); }

  /// The first, second, ... of `count` distances from the nearest to the farthest; at least two.
  double at(std::size_t step, std::size_t count) const {
    return at(static_cast<double>(step) / static_cast<double>(count - 1));
  }
};

}  // namespace raysplats
