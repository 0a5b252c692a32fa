// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "bvh/lbvh.hpp"
#include "device/buffer.hpp"
#include "device/build_options.hpp"
#include "device/context.hpp"
#include "parallel/radix_sort.hpp"
#include "raysplats/camera.hpp"
#include "raysplats/device.hpp"
#include "raysplats/trace_options.hpp"
#include "shared/layout.h"
#include "shared/trace_layout.h"
#include "trace/device_gaussians.hpp"
#include "trace/ray_records.hpp"

namespace raysplats {

/// Whether the rays of cameras walk the tree where they could be traced by tiles as well.
bool walks_tree(const TraceOptions& options, const DeviceInfo& device);

/// Options of rays that are no cones.
TraceOptions of_bare_rays(TraceOptions options);

/// Gaussians whose means are too near to a ray's origin are not met: what TraceOptions::near_depth
/// is for the rays of a camera.
struct RayNear {
  bool limited = false;          ///< NEAR_LIMIT of cl/trace/ray_block.h
  int lens = RS_LENS_PINHOLE;    ///< LENS there: what is limited is depth or distance
  std::array<float, 4> plane{};  ///< axis and depth

  /// Depth along the axis of a camera that looks forward, distance for one that looks around.
  static RayNear of(const Camera& camera, float near_depth);
};

/// Whether work-items take several rays each, in groups of one: on CPUs, which have private memory
/// for the walk of one ray at a time, but where walks go by a trail.
bool shares_items(const DeviceInfo& device, const TreeForm& form);

/// Build options of a kernel that walks rays through an Lbvh (cl/bvh/tree_walk.h).
BuildOptions tree_walk_build(const TreeForm& form);

/// Build options of a kernel that walks rays through Gaussians (cl/trace/ray_walk.h), whose colours
/// have `sh_degree`.
BuildOptions ray_walk_build(const TreeForm& form,
                            const TraceOptions& options,
                            const RayNear& near,
                            int sh_degree);

/// What all rays of a launch share. `color_from_origin` as in RsRayWalk.
RsRayWalk ray_walk(const TraceOptions& options,
                   const RayNear& near,
                   const DeviceGaussians& gaussians,
                   std::int32_t color_from_origin);

/// The order in which a launch takes its rays, so that neighbours cross the same part of the scene.
class RayOrder {
 public:
  explicit RayOrder(Context& context);

  /// What compute() keeps on the device.
  static constexpr std::size_t kBytesPerRay = 2 * sizeof(std::uint32_t) + RadixSort::kBytesPerPair;

  /// False when the rays are taken as they come: there are too few for a sort to pay.
  bool compute(const Lbvh& tree, const Buffer<Ray>& rays, std::size_t count);
  /// RS_RAY_ARGUMENTS of cl/trace/arguments.h, after a compute() that returned `ordered` for these
  /// rays.
  auto arguments(const Buffer<Ray>& rays, bool ordered) const {
    return argument_pack(rays, std::int32_t{ordered}, indices_);
  }

 private:
  Context* context_;
  RadixSort sort_;
  Buffer<std::uint32_t> keys_;
  Buffer<std::uint32_t> indices_;
};

}  // namespace raysplats
