// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "bvh/lbvh.hpp"
#include "device/context.hpp"
#include "raysplats/trace_options.hpp"
#include "trace/device_gaussians.hpp"

namespace raysplats {

/// One ray o + t d, t in [t_min, t_max]; d need not be normalised and t is in units of |d|.
struct Ray {
  float origin[3];
  float t_min;
  float direction[3];
  float t_max;
};

/// Direction in which a Gaussian's colour is evaluated for a ray.
enum class ColorDirection {
  kRay,         ///< the ray's own direction (secondary rays, cameras without a centre)
  kFromOrigin,  ///< from the ray's origin to the mean (what camera rays use)
};

struct RayResult {
  float color[3];  ///< background blended
  float alpha;     ///< 1 - transmittance
  float expected_depth;
  float median_depth;
  std::uint32_t hits;
  std::uint32_t capped;  ///< 1 when the ray stopped because of max_hits
};

/// Traces arbitrary rays: any origins and directions, without coherence.
class RayTracer {
 public:
  RayTracer(Context& context, const TraceOptions& options);
  ~RayTracer();
  void update(const DeviceGaussians& gaussians);
  std::vector<RayResult> trace(const DeviceGaussians& gaussians,
                               std::span<const Ray> rays,
                               ColorDirection color_direction = ColorDirection::kRay);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace raysplats
