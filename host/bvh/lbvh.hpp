// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>
#include <vector>

#include "device/buffer.hpp"
#include "device/build_options.hpp"
#include "device/context.hpp"
#include "parallel/chunk_shape.hpp"
#include "parallel/radix_sort.hpp"
#include "shared/layout.h"

namespace raysplats {

/// How rays walk a tree, and how its numbers lie in memory for that (cl/bvh/lbvh_node.h).
struct TreeForm {
  int lanes = 4;       ///< children of a node and things in a leaf block: 4, 8 or 16
  bool trail = false;  ///< one thing at a time, and no stack (TRAIL): for GPUs, of 4 lanes

  bool operator==(const TreeForm&) const = default;
};

/// CPUs test all lanes at once, as many as their vectors of floats have (at least 4); others walk
/// by a trail.
TreeForm tree_form(const DeviceInfo& device);
/// What kernels define that read or write nodes and blocks of such a tree.
BuildOptions tree_build(const TreeForm& form);

/// Linear bounding volume hierarchy over boxes (Lauterbach et al. 2009), made on the device and
/// walked by all rays (cl/bvh/lbvh_node.h): boxes along a Hilbert curve (64-bit codes of their
/// centres; a few boxes far from the others do not coarsen the others' grid), groups of them
/// ordered again by the surface area heuristic, then blocks of `lanes` and nodes of `lanes`
/// children by position alone. There are no pointers, every block but the last is full, and a refit
/// keeps the order. Gaussians and triangles use the same tree; what a block holds is theirs.
///
/// A build is: order(); a kernel of the owner's that fills the blocks and stores their boxes as the
/// children of level 1, padded_blocks() of them from node 0 on; merge(). A refit is the last two.
class Lbvh {
 public:
  /// Throws UsageError for a form that there is not.
  Lbvh(Context& context, const TreeForm& form);
  /// A tree with an explicit division of the work for ordering.
  Lbvh(Context& context, const TreeForm& form, const ChunkShape& shape);

  /// What order() and merge() keep on the device for every box, beside the boxes and the blocks.
  static std::size_t bytes_per_box(const TreeForm& form);

  /// Order and shape of the tree over boxes[0..count). Boxes that are empty or not finite come
  /// last. Throws UsageError for 2^31 boxes and when the buffer is shorter; whatever else it throws
  /// leaves the tree empty.
  void order(const Buffer<RsAabb>& boxes, std::size_t count);
  /// Boxes of all levels above the first.
  void merge();

  /// What the tree costs to walk after the surface area heuristic (Goldsmith and Salmon 1987):
  /// nodes and blocks that a random line through the grid's window meets for every box of
  /// boxes[0..size()) that it meets. It grows while boxes move away from the order of the last
  /// order(); compare with the value right after that. 0 where all boxes are empty. One pass over
  /// nodes and boxes; waits for the device.
  double cost(const Buffer<RsAabb>& boxes);

  std::size_t size() const { return count_; }
  const TreeForm& form() const { return form_; }
  int lanes() const { return form_.lanes; }
  /// Positions along the curve that are ordered again together.
  std::size_t order_group() const;
  std::size_t block_count() const;
  /// Blocks rounded up to whole nodes: lanes of nodes without a block must become empty boxes.
  std::size_t padded_blocks() const;
  /// Levels of nodes; 0 for an empty tree.
  int levels() const { return static_cast<int>(level_sizes_.size()); }
  /// Nodes of level l = 1..levels() at [l - 1].
  const std::vector<std::size_t>& level_sizes() const { return level_sizes_; }
  /// First node of level l = 1..levels() at [l]; level 1 has blocks as children.
  const Buffer<std::uint32_t>& level_begin() const { return level_begin_; }
  /// Behind the root, at scene_node(), lane 0 of a further node holds the box of everything.
  const Buffer<float>& nodes() const { return nodes_; }
  std::uint32_t scene_node() const { return scene_node_; }
  /// RS_TREE_ARGUMENTS of cl/bvh/lbvh_node.h, with the owner's leaf blocks.
  auto arguments(const Buffer<float>& blocks) const {
    return argument_pack(levels(), level_begin_, nodes_, blocks);
  }
  /// Box index of every slot (block times lanes plus lane).
  const Buffer<std::uint32_t>& slots() const { return order_; }

 private:
  void sort_along_curve(const Buffer<RsAabb>& boxes, std::size_t count);
  Kernel kernel(std::string_view program, const char* name) const;

  Context* context_;
  TreeForm form_;
  ChunkShape shape_;
  RadixSort sort_;
  std::size_t count_ = 0;
  std::vector<std::size_t> level_sizes_;  // from level 1
  std::uint32_t scene_node_ = 0;
  Buffer<RsAabb> partials_;
  Buffer<float> grid_;
  Buffer<std::uint32_t> high_;      // sorted high words of the codes
  Buffer<std::uint32_t> low_;       // low words by box
  Buffer<std::uint32_t> too_long_;  // a run of equal high words was not repaired in place
  Buffer<std::uint32_t> scratch_;
  Buffer<std::uint32_t> order_;
  Buffer<std::uint32_t> level_begin_;
  Buffer<float> nodes_;
  Buffer<float> areas_;
};

}  // namespace raysplats
