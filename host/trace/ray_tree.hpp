// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "primitives/radix_sort.hpp"
#include "raysplats/trace_options.hpp"
#include "shared/layout.h"
#include "trace/device_gaussians.hpp"

namespace raysplats {

/// Lanes of the vectors that arbitrary rays are traced with: children of a node and Gaussians of a
/// leaf block. `lanes` of 4, 8 or 16; 0 chooses the device's float vector width on CPUs (at least
/// 4) and 4 elsewhere. Throws UsageError for other widths.
int ray_lanes(const DeviceInfo& device, int lanes);

/// Tree over Gaussians for rays without coherence, made on the device (cl/trace/ray_block.h): the
/// Gaussians along a Hilbert curve, groups of them ordered again by the surface area heuristic,
/// then blocks of `lanes` Gaussians and nodes of `lanes` children by position alone. There are no
/// pointers, every block but the last is full, and a refit keeps the order.
class RayTree {
 public:
  RayTree(Context& context, const TraceOptions& options, int lanes);

  void build(const DeviceGaussians& gaussians);
  /// For Gaussians that changed but kept their number since build(). Throws UsageError otherwise.
  void refit(const DeviceGaussians& gaussians);

  std::size_t size() const { return count_; }
  int lanes() const { return lanes_; }
  /// Levels of nodes; 0 for an empty tree.
  int levels() const { return static_cast<int>(level_sizes_.size()); }
  /// First node of level l = 1..levels() at [l]; level 1 has blocks as children.
  const Buffer<std::uint32_t>& level_begin() const { return level_begin_; }
  /// Behind the root, at scene_node(), lane 0 of a further node holds the box of everything.
  const Buffer<float>& nodes() const { return nodes_; }
  std::uint32_t scene_node() const { return scene_node_; }
  const Buffer<float>& blocks() const { return blocks_; }
  /// Gaussian of every slot (block times lanes plus lane).
  const Buffer<std::uint32_t>& order() const { return order_; }

 private:
  void compute_boxes(const DeviceGaussians& gaussians);
  void sort_along_curve();
  void fill(const DeviceGaussians& gaussians);
  std::size_t block_count() const;

  Context* context_;
  TraceOptions options_;
  int lanes_;
  RadixSort sort_;
  std::size_t count_ = 0;
  std::vector<std::size_t> level_sizes_;  // from level 1
  std::uint32_t scene_node_ = 0;
  Buffer<RsAabb> boxes_;
  Buffer<RsAabb> partials_;
  Buffer<float> grid_;
  Buffer<std::uint32_t> high_;
  Buffer<std::uint32_t> low_;
  Buffer<std::uint32_t> order_;
  Buffer<std::uint32_t> level_begin_;
  Buffer<float> nodes_;
  Buffer<float> blocks_;
};

}  // namespace raysplats
