// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

namespace raysplats {

/// One ray o + t d, t in [t_min, t_max]; d need not be normalised, and every t is in units of |d|.
struct Ray {
  float origin[3];     ///< world units, at most 1e19 from 0
  float t_min;         ///< at least 0
  float direction[3];  ///< of a length above 0, at most 1e19
  float t_max;         ///< at least t_min; infinity: without end
};

/// Direction in which a Gaussian's colour is evaluated for a ray.
enum class ColorDirection {
  kRay,         ///< the ray's own direction (secondary rays, cameras without a centre)
  kFromOrigin,  ///< from the ray's origin to the mean (what camera rays use)
};

/// What a ray met.
struct RayResult {
  float color[3];        ///< background blended
  float alpha;           ///< 1 - transmittance
  float expected_depth;  ///< mean depth of the hits' strongest response, weighted by what they show
  float median_depth;    ///< of the hit behind which less than half of the light is left; 0 = none
  std::uint32_t hits;    ///< blended Gaussians
  std::uint32_t capped;  ///< 1 when the ray stopped because of max_hits
};

/// Gradient of a loss for what a ray met.
struct RayResultGradient {
  float color[3];  ///< dL/dR, dL/dG, dL/dB
  float alpha;     ///< dL/dalpha
};

/// Gradient of a loss for a ray itself; its ends t_min and t_max are constants.
struct RayGradient {
  float origin[3];     ///< dL/d(origin)
  float direction[3];  ///< dL/d(direction) as it was given, of any length
};

}  // namespace raysplats
