// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "raysplats/camera.hpp"
#include "reference/gaussian.hpp"
#include "scene/image/pixel_count.hpp"

namespace raysplats::reference {

/// Direction a Gaussian's colour is evaluated in.
enum class ColorMode {
  kFromOrigin,  ///< from the ray's origin to the mean (camera rays)
  kAlongRay,    ///< the ray's own direction (secondary rays)
};

/// One blended hit. t values are in units of |direction|.
struct Hit {
  std::uint32_t index = 0;
  double t = 0.0;              ///< key the hits are ordered by
  double t_peak = 0.0;         ///< depth of the maximum response
  double alpha = 0.0;          ///< opacity times response
  double transmittance = 1.0;  ///< before this hit
  double slope = 0.0;          ///< s = <o', d'> / <d', d'>
  glm::dvec3 residual{0.0};    ///< v = o' - s d', in whitened space
  glm::dvec3 color{0.0};
};

struct RayTrace {
  glm::dvec3 color{0.0};        ///< background blended
  double alpha = 0.0;           ///< 1 - transmittance
  double transmittance = 1.0;   ///< left for the background
  double expected_depth = 0.0;  ///< sum w t_peak / sum w with w = T alpha; 0 without hits
  double median_depth = 0.0;    ///< t_peak of the hit that brings T below 0.5; 0 when none does
  bool capped = false;          ///< max_hits ended the ray while light and hits were left
  /// Smallest relative distance of any decision of this ray (inside or outside an ellipsoid, in
  /// front or behind, order of neighbours, stop) from going the other way: comparisons in single
  /// precision skip rays with a tiny one.
  double margin = 1.0;
  std::vector<Hit> hits;  ///< front to back
};

/// What all rays of a scene share, computed once.
struct PreparedGaussian {
  glm::dvec3 mean{0.0};
  glm::dmat3 whitening{1.0};
  double opacity = 0.0;
  double quantile = 0.0;
  bool visible = true;  ///< false: skipped by every ray
};
std::vector<PreparedGaussian> prepare(const Parameters& parameters, const TraceOptions& options);

/// How wide a ray is at t along its direction of unit length: width + spread t.
struct Cone {
  double width = 0.0;
  double spread = 0.0;
};

/// Brute force over all Gaussians, directly after docs/model.md. A hit's key must lie in [t_min,
/// t_max] and be at least 0. `direction` need not be normalised. near_depth has no meaning for a
/// single ray and is ignored.
RayTrace trace_ray(const Parameters& parameters,
                   const TraceOptions& options,
                   const glm::dvec3& origin,
                   const glm::dvec3& direction,
                   double t_min,
                   double t_max,
                   ColorMode color_mode);
/// The same for Gaussians from prepare(), as a cone sees them: none thinner than it is beside their
/// means.
RayTrace trace_ray(const Parameters& parameters,
                   const std::vector<PreparedGaussian>& prepared,
                   const TraceOptions& options,
                   const glm::dvec3& origin,
                   const glm::dvec3& direction,
                   double t_min,
                   double t_max,
                   ColorMode color_mode,
                   const Cone& cone = {});

struct Render {
  int width = 0;
  int height = 0;
  std::vector<double> image;   ///< planar R, G, B (background blended), A; 4 x height x width
  std::vector<double> depth;   ///< planar expected depth, median depth, hits; 3 x height x width
  std::vector<double> margin;  ///< RayTrace::margin per pixel
  std::uint64_t capped_rays = 0;
  std::uint64_t hits = 0;
  std::uint64_t signature = 0;  ///< hash of every ray's sequence of Gaussian indices

  std::size_t pixels() const { return pixel_count(width, height); }
};

/// The cone of a ray of the camera along a unit direction in world coordinates.
Cone pixel_cone(const Camera& camera, const TraceOptions& options, const glm::dvec3& direction);

/// Direction (X, Y, 1) of a pixel's centre in camera axes: t is then the depth along the camera's z
/// axis.
glm::dvec3 pixel_direction(const Camera& camera, int column, int row);

/// prepare() for one view: Gaussians nearer than near_depth along the camera's z axis are not
/// visible, and none is thinner than view_footprint.
std::vector<PreparedGaussian> prepare_view(const Parameters& parameters,
                                           const TraceOptions& options,
                                           const Camera& camera);

/// One ray per pixel of a pinhole camera.
Render render(const Parameters& parameters, const TraceOptions& options, const Camera& camera);

}  // namespace raysplats::reference
