// SPDX-License-Identifier: Apache-2.0
#include "reference/triangles.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace raysplats::reference {
namespace {

void lower(double& margin, double distance) { margin = std::min(margin, std::abs(distance)); }

}  // namespace

std::vector<Triangle> triangles_of(const std::vector<Mesh>& meshes) {
  std::vector<Triangle> out;
  for (const Mesh& mesh : meshes) {
    for (std::size_t i = 0; i < mesh.triangle_count(); ++i) {
      Triangle triangle;
      triangle.material = mesh.materials[i];
      for (std::size_t k = 0; k < 3; ++k) {
        const std::size_t v = mesh.triangles[3 * i + k];
        const float* p = &mesh.positions[3 * v];
        triangle.corners[k] = {p[0], p[1], p[2]};
        if (!mesh.uvs.empty()) triangle.uvs[k] = {mesh.uvs[2 * v], mesh.uvs[2 * v + 1]};
      }
      const glm::dvec3 area = glm::cross(triangle.corners[1] - triangle.corners[0],
                                         triangle.corners[2] - triangle.corners[0]);
      if (glm::length(area) > 0.0) triangle.normal = glm::normalize(area);
      for (std::size_t k = 0; k < 3; ++k) {
        triangle.normals[k] = triangle.normal;
        if (mesh.normals.empty()) continue;
        const float* n = &mesh.normals[3 * std::size_t{mesh.triangles[3 * i + k]}];
        triangle.normals[k] = {n[0], n[1], n[2]};
      }
      out.push_back(triangle);
    }
  }
  return out;
}

bool meets(const Triangle& triangle,
           const glm::dvec3& origin,
           const glm::dvec3& direction,
           TriangleHit& hit,
           double& distance) {
  distance = std::numeric_limits<double>::infinity();
  const glm::dvec3 a = triangle.corners[0] - origin;
  const glm::dvec3 b = triangle.corners[1] - origin;
  const glm::dvec3 c = triangle.corners[2] - origin;
  const glm::dvec3 volumes(glm::dot(direction, glm::cross(b, c)),
                           glm::dot(direction, glm::cross(c, a)),
                           glm::dot(direction, glm::cross(a, b)));
  const double sum = volumes.x + volumes.y + volumes.z;
  const double slope = glm::dot(direction, triangle.normal);
  if (sum == 0.0 || slope == 0.0) return false;
  hit.t = glm::dot(a, triangle.normal) / slope;
  hit.weights = volumes / sum;
  distance = std::abs(std::min({hit.weights.x, hit.weights.y, hit.weights.z}));
  const bool none_negative = volumes.x >= 0.0 && volumes.y >= 0.0 && volumes.z >= 0.0;
  const bool none_positive = volumes.x <= 0.0 && volumes.y <= 0.0 && volumes.z <= 0.0;
  return none_negative || none_positive;
}

TriangleHit nearest_triangle(std::span<const Triangle> triangles,
                             const glm::dvec3& origin,
                             const glm::dvec3& direction,
                             double t_after,
                             int skip,
                             double& margin) {
  struct Candidate {
    double t, distance;
    bool met;
  };
  std::vector<Candidate> candidates;
  TriangleHit best;
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    if (static_cast<int>(i) == skip) continue;
    TriangleHit hit;
    double distance = 0.0;
    const bool met = meets(triangles[i], origin, direction, hit, distance);
    if (!std::isfinite(distance)) continue;
    candidates.push_back({hit.t, distance, met});
    if (!met || !(hit.t > t_after && hit.t < best.t)) continue;
    best = hit;
    best.triangle = static_cast<int>(i);
  }
  for (const Candidate& c : candidates) {
    if (c.t > t_after && c.t <= best.t) lower(margin, c.distance);
    if (!c.met) continue;
    lower(margin, c.t - t_after);
    if (c.t != best.t && std::isfinite(best.t)) lower(margin, (c.t - best.t) / best.t);
  }
  return best;
}

double triangle_transmittance(std::span<const Triangle> triangles,
                              const std::vector<Material>& materials,
                              const glm::dvec3& origin,
                              const glm::dvec3& direction,
                              double t_after,
                              double t_max,
                              int skip,
                              double& margin) {
  double out = 1.0;
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    if (static_cast<int>(i) == skip) continue;
    const double opacity = shadow_opacity(materials[triangles[i].material]);
    if (opacity <= 0.0) continue;
    TriangleHit hit;
    double distance = 0.0;
    const bool met = meets(triangles[i], origin, direction, hit, distance);
    const bool between = hit.t > t_after && hit.t < t_max;
    if (std::isfinite(distance) && between) lower(margin, distance);
    if (!met) continue;
    lower(margin, hit.t - t_after);
    if (std::isfinite(t_max)) lower(margin, (hit.t - t_max) / t_max);
    if (between) out *= 1.0 - opacity;
  }
  return out;
}

}  // namespace raysplats::reference
