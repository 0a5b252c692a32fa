// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "light/normal_gaussians.hpp"
#include "light/view_tracer.hpp"
#include "raysplats/camera.hpp"
#include "raysplats/image.hpp"
#include "raysplats/trace_options.hpp"
#include "trace/device_gaussians.hpp"

namespace raysplats {

/// Pictures of normals (Tracer::normals()), traced as colours, so every camera and way of finding
/// hits is known.
class NormalPictures {
 public:
  NormalPictures(Context& context, const TraceOptions& options);

  /// Sum of w n over the hits of every pixel, n the normals of the Gaussians in world axes; 3
  /// channels. Throws as ViewTracer::forward(), and what `watch` throws.
  Image draw(const DeviceGaussians& gaussians,
             const Camera& camera,
             const std::function<bool(double share)>& watch = {});

 private:
  NormalGaussians normals_;
  ViewTracer views_;
};

}  // namespace raysplats
