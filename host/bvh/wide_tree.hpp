// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "primitives/radix_sort.hpp"
#include "shared/layout.h"

namespace raysplats {

/// Lanes of the vectors that arbitrary rays are traced with: children of a node and things in a
/// leaf block. `lanes` of 4, 8 or 16; 0 chooses the device's float vector width on CPUs (at least
/// 4) and 4 elsewhere. Throws UsageError for other widths.
int ray_lanes(const DeviceInfo& device, int lanes);

/// Tree over boxes for rays without coherence, made on the device (cl/bvh/wide_node.h): boxes along
/// a Hilbert curve, groups of them ordered again by the surface area heuristic, then blocks of
/// `lanes` and nodes of `lanes` children by position alone. There are no pointers, every block but
/// the last is full, and a refit keeps the order. Gaussians and triangles use the same tree; what a
/// block holds is theirs.
///
/// A build is: order(); a kernel of the owner's that fills the blocks and stores their boxes as the
/// children of level 1, padded_blocks() of them from node 0 on; merge(). A refit is the last two.
class WideTree {
 public:
  WideTree(Context& context, int lanes);

  /// Order and shape of the tree over boxes[0..count). Boxes that are empty or not finite come
  /// last.
  void order(const Buffer<RsAabb>& boxes, std::size_t count);
  /// Boxes of all levels above the first.
  void merge();

  std::size_t size() const { return count_; }
  int lanes() const { return lanes_; }
  std::size_t block_count() const;
  /// Blocks rounded up to whole nodes: lanes of nodes without a block must become empty boxes.
  std::size_t padded_blocks() const;
  /// Levels of nodes; 0 for an empty tree.
  int levels() const { return static_cast<int>(level_sizes_.size()); }
  /// First node of level l = 1..levels() at [l]; level 1 has blocks as children.
  const Buffer<std::uint32_t>& level_begin() const { return level_begin_; }
  /// Behind the root, at scene_node(), lane 0 of a further node holds the box of everything.
  const Buffer<float>& nodes() const { return nodes_; }
  std::uint32_t scene_node() const { return scene_node_; }
  /// Box index of every slot (block times lanes plus lane).
  const Buffer<std::uint32_t>& slots() const { return order_; }

 private:
  void sort_along_curve(const Buffer<RsAabb>& boxes);

  Context* context_;
  int lanes_;
  RadixSort sort_;
  std::size_t count_ = 0;
  std::vector<std::size_t> level_sizes_;  // from level 1
  std::uint32_t scene_node_ = 0;
  Buffer<RsAabb> partials_;
  Buffer<float> grid_;
  Buffer<std::uint32_t> high_;
  Buffer<std::uint32_t> low_;
  Buffer<std::uint32_t> order_;
  Buffer<std::uint32_t> level_begin_;
  Buffer<float> nodes_;
};

}  // namespace raysplats
