// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <span>
#include <vector>

#include "raysplats/scene.hpp"

namespace raysplats::reference {

struct Triangle {
  std::array<glm::dvec3, 3> corners;
  std::array<glm::dvec3, 3> normals;  ///< the triangle's own where the mesh has none
  std::array<glm::dvec2, 3> uvs{};
  glm::dvec3 normal{0.0};  ///< unit, by the right hand; zero when the triangle has no area
  std::size_t material = 0;
};

/// The triangles of all meshes in order.
std::vector<Triangle> triangles_of(const std::vector<Mesh>& meshes);

struct TriangleHit {
  int triangle = -1;  ///< -1: none
  double t = std::numeric_limits<double>::infinity();
  glm::dvec3 weights{0.0};  ///< barycentric, of the three corners
};

/// One triangle, both sides, edges included: the signs of the volumes that the ray spans with the
/// edges, which neighbours share to the last bit (Plücker's test). `distance` becomes how far the
/// smallest barycentric weight is from 0, huge for rays in the triangle's plane.
bool meets(const Triangle& triangle,
           const glm::dvec3& origin,
           const glm::dvec3& direction,
           TriangleHit& hit,
           double& distance);

/// The nearest of all triangles with t > t_after but `skip`, the lowest index at ties. `margin` is
/// lowered to the smallest relative distance of a decision from going the other way.
TriangleHit nearest_triangle(std::span<const Triangle> triangles,
                             const glm::dvec3& origin,
                             const glm::dvec3& direction,
                             double t_after,
                             int skip,
                             double& margin);

/// Product of 1 - shadow opacity over the triangles met in (t_after, t_max) but `skip`.
double triangle_transmittance(std::span<const Triangle> triangles,
                              const std::vector<Material>& materials,
                              const glm::dvec3& origin,
                              const glm::dvec3& direction,
                              double t_after,
                              double t_max,
                              int skip,
                              double& margin);

}  // namespace raysplats::reference
