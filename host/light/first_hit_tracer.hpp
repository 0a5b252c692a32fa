// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "light/normal_gaussians.hpp"
#include "light/surface_store.hpp"
#include "raysplats/camera.hpp"
#include "raysplats/rays.hpp"
#include "trace/camera_rays.hpp"
#include "trace/device_gaussians.hpp"
#include "trace/ray_tracer.hpp"

namespace raysplats {

/// Traces what the rays of a camera meet first (PathTracer::first_hits()), ray by ray, through a
/// tree of its own.
class FirstHitTracer {
 public:
  /// `options` with a black background.
  FirstHitTracer(Context& context, const TraceOptions& options)
      : context_(context), normals_(context), tracer_(context, options), camera_rays_(context) {}

  /// Of the pixels [first, first + count): color is the sum of w n, depths count as in pictures,
  /// alpha is 1 where there is a surface, hits are Gaussians before it.
  std::vector<RayResult> trace(const DeviceGaussians& gaussians,
                               SurfaceStore& surfaces,
                               const Camera& camera,
                               std::size_t first,
                               std::size_t count);

 private:
  Context& context_;
  NormalGaussians normals_;
  RayTracer tracer_;  // of what carries normals as colours, which stand in the tree's leaves
  CameraRays camera_rays_;
  Buffer<Ray> rays_;
  Buffer<RsCone> cones_;
  Buffer<RsSurfaceHit> hits_;
  Buffer<RayResult> results_;
};

}  // namespace raysplats
