// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>

#include "device/context.hpp"
#include "raysplats/camera.hpp"
#include "raysplats/image.hpp"
#include "raysplats/mirrors.hpp"
#include "raysplats/pose_gradient.hpp"
#include "raysplats/trace_options.hpp"
#include "trace/camera_tracer.hpp"
#include "trace/device_gaussians.hpp"
#include "trace/sky.hpp"

namespace raysplats {

class RayTracer;

/// Pictures of Gaussians from cameras of every model, forward and backward: in packets of rays
/// where the camera has a centre (CameraTracer); with Traversal::kBvh, other cameras and scenes
/// with mirrors ray by ray (RayTracer, MirrorPaths). Boxes and trees follow the revision of the
/// Gaussians and are made when a view first needs them.
class ViewTracer {
 public:
  /// Rays of camera pixels that are traced at once where they are traced one by one.
  static std::size_t batch(const TraceOptions& options, const DeviceInfo& device);

  /// Throws UsageError for options out of range, for a negative number of bounces, and for
  /// options.depth, options.near_depth, options.sky or Traversal::kTiles with mirrors.
  ViewTracer(Context& context, const TraceOptions& options, Mirrors mirrors = {});
  ~ViewTracer();

  /// Of the mirrors.
  std::size_t triangles() const;
  /// Whether a view of this camera is traced ray by ray.
  bool by_rays(const Camera& camera) const;

  /// What traces views ray by ray; null where none has asked for it yet.
  RayTracer* ray_tracer();

  /// CameraTracer::begin_programs(); nothing for views that are traced ray by ray.
  void begin_programs(const DeviceGaussians& gaussians,
                      const Camera& camera,
                      bool keep,
                      bool depth_gradient);

  /// Traces one view. With `keep` backward() may follow; what it needs stays where the memory
  /// budget has room and is traced again where not. Throws UsageError for a camera without pixels
  /// or focal length, and for one that Traversal::kTiles cannot trace.
  void forward(const DeviceGaussians& gaussians,
               const Camera& camera,
               bool keep = false,
               ViewSizes sizes = ViewSizes::kAwaited);
  /// CameraTracer::set_share() and rows(), of views that are traced ray by ray too, without `keep`.
  void set_share(std::size_t part, std::size_t parts);
  std::array<int, 2> rows() const;
  /// Of views that were traced with ViewSizes::kAhead, as CameraTracer says; those that are traced
  /// ray by ray wait for their sizes and always fit.
  const Buffer<std::uint32_t>& overflow() const;
  void clear_overflow();
  /// The same ray by ray, whatever the camera's model.
  void forward_rays(const DeviceGaussians& gaussians, const Camera& camera, bool keep = false);

  /// Result of the last forward(): planar R, G, B (background blended), A; 4 x height x width. A is
  /// the share of light that does not come from the background. Pixels that a lens does not see
  /// show the background.
  const Buffer<float>& image() const;
  /// With options.depth: planar expected depth, median depth, hits per ray; 3 x height x width.
  /// Depth is along z for kPinhole, kOpenCv and kOrthographic, along the ray for the others.
  const Buffer<float>& depth() const;
  /// The same as interleaved host images; UsageError for a depth that was not traced.
  Image download_image() const;
  Image download_depth() const;

  /// Gradients of the last forward(keep = true) view from `image_gradient` (planar dL/dR, dL/dG,
  /// dL/dB, dL/dA; 4 x height x width). Overwrites `gradients`, growing its buffers as needed. With
  /// `pose` also the gradient for the camera's pose. Throws UsageError when the Gaussians changed
  /// since, and for the pose of a camera that looks into mirrors or sees a sky. `depth_gradient` as
  /// in CameraTracer::backward(); UsageError for views that are traced ray by ray.
  void backward(const DeviceGaussians& gaussians,
                const Buffer<float>& image_gradient,
                GaussianGradients& gradients,
                PoseGradient* pose = nullptr,
                const Buffer<float>* depth_gradient = nullptr);

  /// From the next forward() on `watch` hears the share of the picture that is done, several times
  /// a second, and lets forward() end with Error(kInterrupted) by returning false.
  void set_watch(const std::function<bool(double share)>& watch);
  /// What is behind everything from the next forward() on: a colour, or a sky in its place. Throws
  /// UsageError for a sky with mirrors and as Sky.
  void set_background(const std::array<float, 3>& background, const SkyLight& sky = {});
  /// The sky of the next view, whose coefficients may be changed, and the gradient that backward()
  /// has found for it; null without one.
  Sky* sky();
  /// Rays of the last view that stopped because of max_hits, those that mirrors have reflected with
  /// them; blocks.
  std::uint64_t capped_rays() const;
  /// Rays of the last view that mirrors have reflected.
  std::uint64_t reflected_rays() const;
  /// What the last view took, on every device the same; zeros where it was traced ray by ray.
  /// Blocks.
  CameraTracer::Statistics statistics() const;
  /// capped_rays() on the device, until backward().
  struct CappedRays {
    const Buffer<std::uint32_t>& words;
    std::uint32_t place;  ///< of the lower word of the count
    bool wide;            ///< whether the next one is its higher word
  };
  CappedRays capped_on_device() const;
  const Context& context() const;

 private:
  struct Rays;
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace raysplats
