// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "reference/light.hpp"

namespace raysplats::reference {

/// A point of a surface as its material sees it (docs/light.md, "Materials").
struct SurfacePoint {
  int triangle = -1;
  glm::dvec3 position{0.0};
  glm::dvec3 shadow_origin{0.0};     ///< where rays to lights start
  glm::dvec3 shading_normal{0.0};    ///< n, turned to the ray's side
  glm::dvec3 geometric_normal{0.0};  ///< N, turned to the ray's side
  bool from_outside = true;          ///< the ray meets the side that N points to unturned
  glm::dvec3 color{1.0};             ///< c: colour times texture
};

SurfacePoint surface_point(const LightScene& scene,
                           const TriangleHit& hit,
                           const glm::dvec3& origin,
                           const glm::dvec3& direction,
                           double& margin);

/// What a diffuse surface shows: ambient, environment, lights and their highlights.
glm::dvec3 diffuse_light(const LightScene& scene,
                         const Material& material,
                         const SurfacePoint& point,
                         const glm::dvec3& direction,
                         double& margin);

/// The shadow s of Gaussians whose depth is at `point` and which Gaussian `leading` leads.
double gaussian_shadow(const LightScene& scene,
                       const glm::dvec3& point,
                       std::size_t leading,
                       double& margin);

}  // namespace raysplats::reference
