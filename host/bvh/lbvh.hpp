// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "primitives/chunk_shape.hpp"
#include "primitives/radix_sort.hpp"
#include "shared/layout.h"

namespace raysplats {

/// Linear bounding volume hierarchy over boxes, built and refitted on the device: 64-bit Morton
/// codes of the box centres (ties broken by index; a few boxes far from the others do not coarsen
/// the others' grid), stable radix sort, hierarchy after Karras 2012
/// with its node numbers. No atomics: the result does not depend on scheduling, on the device or on
/// how the work is divided.
class Lbvh {
 public:
  explicit Lbvh(Context& context);
  /// With an explicit division of the work for sorting and for building. A group size of 1 makes
  /// subtrees in sequential chunks (CPUs), larger ones search every node's range in parallel.
  Lbvh(Context& context, const ChunkShape& shape);

  /// Builds over boxes[0..count). Empty boxes (lo > hi) and non-finite ones become leaves with
  /// empty bounds (lo = FLT_MAX, hi = -FLT_MAX) at the end of the order. Throws UsageError when the
  /// buffer is shorter.
  void build(const Buffer<RsAabb>& boxes, std::size_t count);
  /// New bounds for the tree of the last build(); `boxes` must hold as many boxes.
  void refit(const Buffer<RsAabb>& boxes);

  /// What the tree costs to walk: inner nodes that a random line meets for every leaf box it meets
  /// (area of the inner boxes over area of the leaf boxes, after Goldsmith and Salmon 1987). It
  /// grows while the boxes move away from the order of the last build(); compare with the value
  /// right after that. 0 where all boxes are empty. One pass over the nodes; waits for the device.
  double cost();

  std::size_t size() const { return count_; }
  /// Reference of the root: 0, or ~0 for a single leaf. There is no root when size() is 0.
  std::int32_t root() const { return count_ == 1 ? ~0 : 0; }
  /// size() - 1 inner nodes.
  const Buffer<RsBvhNode>& nodes() const { return nodes_; }
  /// Box index of every leaf, in Morton order.
  const Buffer<std::uint32_t>& leaves() const { return leaves_; }

 private:
  void sort_by_code(const Buffer<RsAabb>& boxes);
  void bound_leaves(const Buffer<RsAabb>& boxes, bool refit);
  void bound_spanning(const Buffer<RsAabb>& boxes);
  bool sequential() const { return shape_.group_size == 1; }
  std::size_t block() const;  // leaves per block of the box tree
  std::size_t chunk() const;  // leaves per work-item of spread()
  Range spread() const;

  Context* context_;
  ChunkShape shape_;
  RadixSort sort_;
  Kernel center_bounds_;
  Kernel choose_grid_;
  Kernel morton_codes_;
  Kernel sort_runs_;
  Kernel gather_words_;
  Kernel compute_deltas_;
  Kernel build_chunks_;
  Kernel bound_blocks_;
  Kernel merge_blocks_;
  Kernel find_spanning_;
  Kernel bound_spanning_;
  Kernel sum_areas_;
  std::size_t count_ = 0;
  Buffer<RsBvhNode> nodes_;
  Buffer<std::uint32_t> leaves_;
  Buffer<RsAabb> partials_;
  Buffer<float> grid_;
  Buffer<std::uint32_t> high_;      // sorted high words of the codes
  Buffer<std::uint32_t> low_;       // low words by box
  Buffer<std::uint32_t> too_long_;  // a run of equal high words was not repaired in place
  Buffer<std::uint8_t> delta_;
  Buffer<std::uint32_t> spanning_;
  Buffer<RsAabb> blocks_;
  Buffer<std::array<float, 2>> areas_;
};

}  // namespace raysplats
