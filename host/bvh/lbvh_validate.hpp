// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "bvh/lbvh.hpp"
#include "shared/layout.h"

namespace raysplats {

/// Morton codes of the box centres as Lbvh computes them: 63 bits on a power-of-two grid for all
/// axes over the centres of the valid boxes. Where all but the tails of a sample fit a window of
/// less than a sixteenth of that, the grid covers the window, and the boxes outside get bit 63 and
/// a code on a coarse grid around its middle. Boxes that are empty or not finite get the largest
/// code.
std::vector<std::uint64_t> morton_codes(std::span<const RsAabb> boxes);

/// What validate_lbvh() compares the order of the leaves with.
enum class LeafOrder {
  kMorton,  ///< after build(): codes ascend, equal codes by index
  kAny,     ///< after refit() to boxes that moved
};

/// Checks a tree against the boxes it was last built over or refitted to: every box is one leaf,
/// every node is reached once, ranges are contiguous, child bounds are exactly the union of what is
/// below, leaves are in Morton order. Returns "" or one sentence about the first fault. Reads the
/// whole tree back; O(n log n) on the host.
std::string validate_lbvh(const Lbvh& tree,
                          std::span<const RsAabb> boxes,
                          LeafOrder order = LeafOrder::kMorton);

struct LbvhQuality {
  double sah_cost =
      0;  ///< expected visits of a random line that meets the root: area of all boxes / root area
  int depth = 0;  ///< inner nodes on the longest path
};

/// Surface-area cost (Goldsmith and Salmon 1987) and depth; zeros for fewer than two leaves.
LbvhQuality lbvh_quality(const Lbvh& tree);

}  // namespace raysplats
