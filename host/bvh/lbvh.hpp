// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "primitives/radix_sort.hpp"
#include "shared/layout.h"

namespace raysplats {

/// Linear bounding volume hierarchy over boxes, built and refitted on the device: 63-bit Morton codes of the
/// box centres (ties broken by index), stable radix sort, hierarchy after Karras 2012, bounds from a segment
/// tree over the sorted leaves (no atomics, hence no dependence on scheduling).
class Lbvh {
 public:
  explicit Lbvh(Context& context);

  /// Builds over boxes[0..count). Empty boxes (lo > hi) and non-finite ones become leaves no ray reaches.
  void build(const Buffer<RsAabb>& boxes, std::size_t count);
  /// New bounds for the tree of the last build(); `boxes` must hold as many boxes.
  void refit(const Buffer<RsAabb>& boxes);

  std::size_t size() const { return count_; }
  /// Reference of the root: 0, or ~0 for a single leaf. There is no root when size() is 0.
  std::int32_t root() const { return count_ == 1 ? ~0 : 0; }
  /// size() - 1 inner nodes.
  const Buffer<RsBvhNode>& nodes() const { return nodes_; }
  /// Box index of every leaf, in Morton order.
  const Buffer<std::uint32_t>& leaves() const { return leaves_; }

 private:
  Context* context_;
  std::size_t count_ = 0;
  Buffer<RsBvhNode> nodes_;
  Buffer<std::uint32_t> leaves_;
};

}  // namespace raysplats
