// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <limits>

namespace raysplats {

/// An axis-aligned box, world units; by default all space. No `high` lies below its `low`.
struct Bounds {
  static constexpr double kOpen = std::numeric_limits<double>::infinity();

  std::array<double, 3> low{-kOpen, -kOpen, -kOpen};  ///< least x, y, z
  std::array<double, 3> high{kOpen, kOpen, kOpen};    ///< greatest x, y, z
  /// Whether the point lies inside or on the border.
  bool contains(float x, float y, float z) const {
    return x >= low[0] && x <= high[0] && y >= low[1] && y <= high[1] && z >= low[2] &&
           z <= high[2];
  }
  bool operator==(const Bounds&) const = default;
};

}  // namespace raysplats
