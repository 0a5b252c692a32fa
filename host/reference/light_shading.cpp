// SPDX-License-Identifier: Apache-2.0
#include "reference/light_shading.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <numbers>

namespace raysplats::reference {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr int kRings = 8;
constexpr int kSpokes = 32;
constexpr double kRoundCosine = 0.73;  ///< of corner normals with the triangle's: 43 degrees

glm::dvec3 vector(const std::array<float, 3>& v) { return {v[0], v[1], v[2]}; }

struct LightAt {
  glm::dvec3 direction{0.0};  ///< towards it
  double distance = kInfinity;
  glm::dvec3 color{0.0};  ///< E
};

LightAt light_at(const Light& light, const glm::dvec3& point) {
  LightAt out;
  if (light.kind == Light::Kind::kDirectional) {
    out.direction = -glm::normalize(vector(light.direction));
    out.color = vector(light.color);
    return out;
  }
  const glm::dvec3 way = vector(light.position) - point;
  out.distance = glm::length(way);
  out.direction = way / out.distance;
  out.color = vector(light.color) / (out.distance * out.distance);
  return out;
}

/// The mean of the point's projections onto the planes of the corners and their normals, those that
/// it lies behind, weighted as the corners are (Hanika 2021, Hacking the Shadow Terminator). Of
/// corners whose normals lean farther than those of something round: the point itself.
glm::dvec3 shadow_origin(const Triangle& triangle,
                         const glm::dvec3& weights,
                         const glm::dvec3& point,
                         const glm::dvec3& geometric_normal) {
  glm::dvec3 out(0.0);
  for (int k = 0; k < 3; ++k) {
    const auto corner = static_cast<std::size_t>(k);
    glm::dvec3 projected = point;
    glm::dvec3 n = triangle.normals[corner];
    if (glm::length(n) > 0.0) {
      n = glm::normalize(glm::dot(n, geometric_normal) < 0.0 ? -n : n);
      if (glm::dot(n, geometric_normal) >= kRoundCosine)
        projected -= std::min(0.0, glm::dot(point - triangle.corners[corner], n)) * n;
    }
    out += weights[k] * projected;
  }
  return out;
}

/// V before strength along one shadow ray.
double transmittance(const LightScene& scene,
                     const glm::dvec3& point,
                     const glm::dvec3& direction,
                     double t_after,
                     double t_max,
                     int skip,
                     bool triangles,
                     bool gaussians,
                     const PreparedGaussian* leading,
                     double& margin) {
  double out = 1.0;
  if (triangles) {
    out *= triangle_transmittance(scene.triangles, scene.scene.materials, point, direction, t_after,
                                  t_max, skip, margin);
  }
  if (gaussians && out > 0.0) {
    if (leading != nullptr) {
      // S R^T l: how far the ellipsoid reaches along l.
      const glm::dvec3 along = glm::transpose(glm::inverse(leading->whitening)) * direction;
      t_after = std::max(
          t_after, std::sqrt(static_cast<double>(scene.options.quantile)) * glm::length(along));
    }
    const RayTrace ray = trace_ray(scene.parameters, scene.prepared, scene.options, point,
                                   direction, t_after, t_max, ColorMode::kAlongRay);
    margin = std::min(margin, ray.margin);
    out *= ray.transmittance;
  }
  return out;
}

}  // namespace

double visibility(const LightScene& scene,
                  const Light& light,
                  const glm::dvec3& point,
                  double t_after,
                  int skip,
                  bool triangles,
                  bool gaussians,
                  double& margin,
                  const PreparedGaussian* leading) {
  if (!triangles && !gaussians) return 1.0;
  const LightAt at = light_at(light, point);
  if (light.kind != Light::Kind::kSphere || light.radius <= 0.0f) {
    return transmittance(scene, point, at.direction, t_after, at.distance, skip, triangles,
                         gaussians, leading, margin);
  }
  // Rings of equal area on the disc that faces the point. A ray's own decisions count for little in
  // the mean, so that they leave the margin alone.
  const glm::dvec3 side =
      std::abs(at.direction.x) < 0.9 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
  const glm::dvec3 u = glm::normalize(glm::cross(at.direction, side));
  const glm::dvec3 v = glm::cross(at.direction, u);
  double sum = 0.0;
  for (int ring = 0; ring < kRings; ++ring) {
    const double r = light.radius * std::sqrt((ring + 0.5) / kRings);
    for (int spoke = 0; spoke < kSpokes; ++spoke) {
      const double angle = 2.0 * std::numbers::pi * (spoke + 0.5 * (ring % 2)) / kSpokes;
      const glm::dvec3 target =
          vector(light.position) + r * (std::cos(angle) * u + std::sin(angle) * v);
      const double distance = glm::distance(target, point);
      double ignored = 1.0;
      sum += transmittance(scene, point, (target - point) / distance, t_after, distance, skip,
                           triangles, gaussians, leading, ignored);
    }
  }
  return sum / (kRings * kSpokes);
}

SurfacePoint surface_point(const LightScene& scene,
                           const TriangleHit& hit,
                           const glm::dvec3& origin,
                           const glm::dvec3& direction,
                           double& margin) {
  const Triangle& triangle = scene.triangles[static_cast<std::size_t>(hit.triangle)];
  const Material& material = scene.scene.materials[triangle.material];
  SurfacePoint out;
  out.triangle = hit.triangle;
  out.position = origin + hit.t * direction;
  glm::dvec3 n(0.0);
  glm::dvec2 uv(0.0);
  for (int k = 0; k < 3; ++k) {
    n += hit.weights[k] * triangle.normals[static_cast<std::size_t>(k)];
    uv += hit.weights[k] * triangle.uvs[static_cast<std::size_t>(k)];
  }
  const double slope = glm::dot(direction, triangle.normal);
  out.from_outside = slope < 0.0;
  out.geometric_normal = out.from_outside ? triangle.normal : -triangle.normal;
  out.shading_normal = glm::length(n) > 0.0 ? glm::normalize(n) : out.geometric_normal;
  out.shadow_origin = shadow_origin(triangle, hit.weights, out.position, out.geometric_normal);
  const double lean = glm::dot(out.shading_normal, out.geometric_normal);
  if (lean < 0.0) out.shading_normal = -out.shading_normal;
  margin = std::min({margin, std::abs(slope), std::abs(lean)});
  out.color = vector(material.color);
  if (material.texture >= 0) {
    out.color *=
        sampled(scene.scene.textures[static_cast<std::size_t>(material.texture)], uv.x, uv.y, true);
  }
  return out;
}

glm::dvec3 diffuse_light(const LightScene& scene,
                         const Material& material,
                         const SurfacePoint& point,
                         const glm::dvec3& direction,
                         double& margin) {
  const RenderSettings& render = scene.scene.render;
  const glm::dvec3& n = point.shading_normal;
  const double sharpness = std::clamp(
      2.0 / std::pow(std::max(static_cast<double>(material.roughness), 0.02), 4.0) - 2.0, 1.0, 1e4);
  glm::dvec3 lambert = vector(render.ambient) + scene.environment.on_normal(n);
  glm::dvec3 highlight(0.0);
  for (const Light& light : scene.scene.lights) {
    const LightAt at = light_at(light, point.position);
    const double cosine = glm::dot(n, at.direction);
    if (material.specular > 0.0f) margin = std::min(margin, std::abs(cosine));
    if (cosine <= 0.0) continue;
    const double open =
        visibility(scene, light, point.shadow_origin, 0.0, point.triangle,
                   render.shadows.mesh_on_mesh, render.shadows.gaussians_on_mesh, margin);
    const glm::dvec3 arriving = at.color * (1.0 - render.shadows.strength * (1.0 - open));
    const glm::dvec3 half = glm::normalize(at.direction - direction);
    lambert += arriving * cosine;
    highlight += arriving * std::pow(std::max(0.0, glm::dot(n, half)), sharpness);
  }
  return point.color * lambert + static_cast<double>(material.specular) * highlight;
}

double gaussian_shadow(const LightScene& scene,
                       const glm::dvec3& point,
                       std::size_t leading,
                       double& margin) {
  const ShadowSettings& shadows = scene.scene.render.shadows;
  double sum = 0.0;
  double weights = 0.0;
  for (const Light& light : scene.scene.lights) {
    const LightAt at = light_at(light, point);
    const double weight = std::max({at.color.r, at.color.g, at.color.b});
    const double open =
        visibility(scene, light, point, scene.bias, -1, shadows.mesh_on_gaussians,
                   shadows.gaussians_on_gaussians, margin, &scene.prepared[leading]);
    sum += weight * (1.0 - shadows.strength * (1.0 - open));
    weights += weight;
  }
  return weights > 0.0 ? sum / weights : 1.0;
}

}  // namespace raysplats::reference
