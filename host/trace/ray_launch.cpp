// SPDX-License-Identifier: Apache-2.0
#include "trace/ray_launch.hpp"

#include <algorithm>

#include "scene/camera/camera_model.hpp"
#include "scene/options/trace_option_table.hpp"
#include "trace/ray_tracer.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kGroup = 64;
// Hits that a ray keeps before it blends: in private memory on CPUs, else in local memory, of which
// a group of 64 then takes 7.5 KiB, so that eight groups fit 64 KiB.
constexpr int kRayHits = 256;
constexpr int kKept = 10;
// Fewer rays than this share too little for a sort to pay.
constexpr std::size_t kOrderedRays = 4096;

}  // namespace

bool walks_tree(const TraceOptions& options, const DeviceInfo& device) {
  // The gradient of a footprint is known in packets alone, and what a device is tuned to changes no
  // picture.
  if (options.traversal == Traversal::kAuto)
    return device.tuning && device.tuning->bvh && options.view_footprint <= 0;
  return options.traversal == Traversal::kBvh;
}

TraceOptions of_bare_rays(TraceOptions options) {
  options.view_footprint = 0;
  return options;
}

RayNear RayNear::of(const Camera& camera, float near_depth) {
  RayNear out;
  if (!(near_depth > 0.0f)) return out;
  out.limited = true;
  if (counts_along_ray(camera)) out.lens = RS_LENS_AROUND;
  for (int k = 0; k < 3; ++k) {
    out.plane[static_cast<std::size_t>(k)] = static_cast<float>(camera.rotation[k][2]);
  }
  out.plane[3] = near_depth;
  return out;
}

bool shares_items(const DeviceInfo& device, const TreeForm& form) {
  return device.type == DeviceType::kCpu && !form.trail;
}

BuildOptions tree_walk_build(const TreeForm& form) {
  BuildOptions build = tree_build(form);
  if (form.trail) build.define("GROUP", kGroup);
  return build;
}

BuildOptions ray_walk_build(const TreeForm& form,
                            const TraceOptions& options,
                            const RayNear& near,
                            int sh_degree) {
  BuildOptions build = tree_walk_build(form);
  build.define("NEAR_LIMIT", near.limited ? 1 : 0)
      .define("LENS", near.lens)
      .define("ADAPTIVE_RADIUS", options.adaptive_radius ? 1 : 0)
      .define("PEAK_ORDER", options.hit_order == HitOrder::kPeak ? 1 : 0)
      .define("CONES", has_cones(options) ? 1 : 0);
  if (form.trail) {
    build.define("KEPT", kKept).define("SH_DEGREE", sh_degree);
  } else {
    build.define("RAY_HITS", kRayHits);
  }
  return build;
}

RsRayWalk ray_walk(const TraceOptions& options,
                   const RayNear& near,
                   const DeviceGaussians& gaussians,
                   std::int32_t color_from_origin) {
  RsRayWalk out{};
  std::copy(near.plane.begin(), near.plane.end(), out.near);
  std::copy(options.background.begin(), options.background.end(), out.background);
  out.quantile = options.quantile;
  out.min_transmittance = stopping_transmittance(options);
  out.max_hits = options.max_hits;
  out.sh_coefficients = sh_coefficients(gaussians.sh_degree);
  out.active_degree = gaussians.active_sh_degree;
  out.color_from_origin = color_from_origin;
  return out;
}

RayOrder::RayOrder(Context& context) : context_(&context), sort_(context) {
  indices_ = Buffer<std::uint32_t>(context, 1, "ray order");
}

bool RayOrder::compute(const Lbvh& tree, const Buffer<Ray>& rays, std::size_t count) {
  if (count < kOrderedRays || tree.levels() == 0) return false;
  indices_.ensure(*context_, count, "ray order");
  keys_.ensure(*context_, count, "ray keys");
  context_->kernel("trace/ray_launch.cl", "ray_keys", tree_build(tree.form()))
      .launch(Range::linear(count, kGroup), rays, static_cast<std::uint32_t>(count), tree.nodes(),
              tree.scene_node(), keys_, indices_);
  sort_.sort(keys_, indices_, count);
  return true;
}

}  // namespace raysplats
