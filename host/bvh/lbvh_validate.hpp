// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "bvh/lbvh.hpp"
#include "shared/layout.h"

namespace raysplats {

/// 64-bit codes of the box centres as Lbvh orders by: 21 bits per axis on a power-of-two grid along
/// a Hilbert curve. Where all but the tails of a sample fit a window of less than a sixteenth of
/// the range of all valid centres, the grid covers the window, and the boxes outside get bit 63 and
/// a code on a coarse grid around its middle. Boxes that are empty or not finite get the largest
/// code.
std::vector<std::uint64_t> curve_codes(std::span<const RsAabb> boxes);

/// A tree read back from the device.
struct LbvhCopy {
  std::size_t count = 0;
  std::size_t lanes = 0;
  bool trail = false;                      ///< of its TreeForm
  std::size_t group = 0;                   ///< boxes ordered together
  std::vector<std::size_t> level_sizes;    ///< from level 1
  std::vector<std::uint32_t> level_begin;  ///< of level l at [l]
  std::vector<std::uint32_t> slots;
  std::vector<float> nodes;

  static LbvhCopy of(const Lbvh& tree);
  TreeForm form() const { return {static_cast<int>(lanes), trail}; }
  /// Place in `nodes` of number k of child `lane` of a node: least x y z, greatest x y z.
  std::size_t at(std::size_t node, std::size_t k, std::size_t lane) const;
  /// Box of child `lane` of a node, numbered through all levels.
  RsAabb child(std::size_t node, std::size_t lane) const;
};

/// What validate_lbvh() compares the order of the boxes with.
enum class LeafOrder {
  kCurve,  ///< after order(): groups of order_group() positions ascend along the curve
  kAny,    ///< after a refit to boxes that moved
};

/// Checks a tree against the boxes it was last built over or refitted to: every box has one slot,
/// the order, and that the box of every block, node and the scene is exactly the union of what is
/// below, as a rebuild in the same order would make it. Returns "" or one sentence about the first
/// fault. O(n log n).
std::string validate_lbvh(const LbvhCopy& tree,
                          std::span<const RsAabb> boxes,
                          LeafOrder order = LeafOrder::kCurve);

}  // namespace raysplats
