// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>

#include "device/context.hpp"
#include "light/mirror_paths.hpp"
#include "raysplats/camera.hpp"
#include "raysplats/image.hpp"
#include "raysplats/trace_options.hpp"
#include "trace/device_gaussians.hpp"

namespace raysplats {

/// What CameraTracer is for pinholes, for cameras of every model and scenes with mirrors: one
/// arbitrary ray per pixel, forward and backward. Pixels that see nothing show the background and
/// have no gradients.
class RayViewTracer {
 public:
  /// Rays of camera pixels that are traced at once.
  static std::size_t batch(std::size_t memory_budget);

  /// Throws UsageError for options.near_depth, which cuts for pinholes only, and as MirrorPaths.
  RayViewTracer(Context& context, const TraceOptions& options, const Mirrors& mirrors = {});
  ~RayViewTracer();

  /// The tree over the Gaussians as they are now. forward() needs it after every parameter change.
  void update(const DeviceGaussians& gaussians);

  /// Traces one view. With `keep` its rays stay for backward(), which traces them again when they
  /// do not fit the memory budget at once.
  void forward(const DeviceGaussians& gaussians, const Camera& camera, bool keep = false);

  /// Result of the last forward(): planar R, G, B (background blended), A; 4 x height x width. A is
  /// the share of light that does not come from the background.
  const Buffer<float>& image() const;
  /// The same as an interleaved host image.
  Image download_image() const;

  /// Gradients of the last forward(keep = true) view from `image_gradient` (planar dL/dR, dL/dG,
  /// dL/dB, dL/dA; 4 x height x width). Overwrites `gradients`, growing its buffers as needed.
  void backward(const DeviceGaussians& gaussians,
                const Buffer<float>& image_gradient,
                GaussianGradients& gradients);

  /// Rays of the last forward() that stopped because of max_hits; blocks.
  std::uint64_t capped_rays() const;
  /// Colour behind everything from the next forward() on.
  void set_background(const std::array<float, 3>& background);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace raysplats
