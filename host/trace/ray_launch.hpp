// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "bvh/wide_tree.hpp"
#include "device/buffer.hpp"
#include "device/build_options.hpp"
#include "device/context.hpp"
#include "primitives/radix_sort.hpp"
#include "raysplats/device.hpp"
#include "raysplats/trace_options.hpp"

namespace raysplats {

struct Ray;

/// Build options of a kernel that walks rays through Gaussians (cl/trace/ray_walk.h).
BuildOptions ray_walk_build(const DeviceInfo& device, const TraceOptions& options, int lanes);

/// The order in which a launch takes its rays, so that neighbours cross the same part of the scene.
class RayOrder {
 public:
  explicit RayOrder(Context& context);

  /// False when the rays are taken as they come: there are too few for a sort to pay.
  bool compute(const WideTree& tree, const Buffer<Ray>& rays, std::size_t count);
  /// Ray of every position, after a compute() that returned true.
  const Buffer<std::uint32_t>& indices() const { return indices_; }

 private:
  Context* context_;
  RadixSort sort_;
  Buffer<std::uint32_t> keys_;
  Buffer<std::uint32_t> indices_;
};

}  // namespace raysplats
