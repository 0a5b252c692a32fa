// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "device/context.hpp"
#include "light/ray_view_tracer.hpp"
#include "raysplats/camera.hpp"
#include "raysplats/image.hpp"
#include "raysplats/trace_options.hpp"
#include "trace/camera_tracer.hpp"
#include "trace/device_gaussians.hpp"

namespace raysplats {

/// Known mirrors from mesh files (io::read_mesh). Materials that are mirrors keep their colour, all
/// others reflect everything.
Mirrors load_mirrors(const std::vector<std::string>& paths, int max_bounces);

/// The views of a training step, forward and backward: pinholes in packets (CameraTracer), cameras
/// of other models and scenes with mirrors ray by ray (RayViewTracer).
class StepTracer {
 public:
  StepTracer(Context& context, const TraceOptions& options, Mirrors mirrors = {});

  /// Whether a view of this camera is traced ray by ray.
  bool by_rays(const Camera& camera) const;

  /// It must follow every change of the Gaussians.
  void update();
  void forward(const DeviceGaussians& gaussians, const Camera& camera, bool keep = false);
  /// Result of the last forward(), as CameraTracer's.
  const Buffer<float>& image() const;
  Image download_image() const;
  /// Gradients of the last forward(keep = true) view.
  void backward(const DeviceGaussians& gaussians,
                const Buffer<float>& image_gradient,
                GaussianGradients& gradients);
  /// Colour behind everything from the next forward() on.
  void set_background(const std::array<float, 3>& background);
  /// Rays of the last view that stopped because of max_hits; blocks.
  std::uint64_t capped_rays() const;

 private:
  Context& context_;
  TraceOptions options_;
  Mirrors mirrors_;
  CameraTracer packets_;
  std::optional<RayViewTracer> rays_;  // once a view needs it
  bool packets_updated_ = false;
  bool rays_updated_ = false;
  bool last_by_rays_ = false;
};

}  // namespace raysplats
