// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "device/context.hpp"
#include "raysplats/camera.hpp"
#include "raysplats/image.hpp"
#include "raysplats/trace_options.hpp"
#include "trace/camera_rays.hpp"
#include "trace/camera_tracer.hpp"
#include "trace/device_gaussians.hpp"
#include "trace/ray_tracer.hpp"

namespace raysplats {

/// Pictures of Gaussians from any camera: pinholes in packets of rays (CameraTracer), other models
/// ray by ray (CameraRays and RayTracer).
class ViewTracer {
 public:
  ViewTracer(Context& context, const TraceOptions& options);

  /// It must follow every change of the Gaussians. The tree of single rays is built when the first
  /// camera needs it.
  void update(const DeviceGaussians& gaussians);

  /// RGBA: background blended, A = 1 - T. Throws UsageError for a camera without pixels or focal
  /// length, and for options.near_depth with a camera that is no pinhole.
  Image render(const DeviceGaussians& gaussians, const Camera& camera);
  /// The same ray by ray, whatever the camera's model.
  Image render_rays(const DeviceGaussians& gaussians, const Camera& camera);

  /// Of the last picture, with options.depth: expected depth, median depth, hits per ray. Depth is
  /// along z for kPinhole, kOpenCv and kOrthographic, along the ray for the others.
  Image depth() const;
  /// Rays of the last picture that stopped because of max_hits.
  std::uint64_t capped_rays() const { return capped_rays_; }

 private:
  void store(std::size_t first, std::size_t count, const Camera& camera);

  Context& context_;
  TraceOptions options_;
  CameraTracer packets_;
  CameraRays generator_;
  RayTracer tracer_;
  bool tree_built_ = false;
  bool by_rays_ = false;  ///< the last picture
  Buffer<Ray> rays_;
  Buffer<RayResult> results_;
  std::vector<Ray> host_rays_;
  std::vector<RayResult> host_results_;
  Image image_;
  Image depth_;
  std::uint64_t capped_rays_ = 0;
};

}  // namespace raysplats
