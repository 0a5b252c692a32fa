// SPDX-License-Identifier: Apache-2.0
#include "io/photo/body_outline.hpp"

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <glm/matrix.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <limits>
#include <vector>

#include "scene/camera/camera_model.hpp"
#include "scene/camera/view_axes.hpp"

namespace raysplats::io {
namespace {

// Lengths of the mean of unit vectors that are along a straight edge, and along the view axes.
constexpr double kLeastParallel = 0.95;
constexpr double kMostParallel = 0.97;

// A plane through a camera that should touch the body.
struct Tangent {
  glm::dvec3 eye{0.0};     // from the middle of all cameras
  glm::dvec3 ray{0.0};     // through the edge
  glm::dvec3 normal{0.0};  // to the body
};

glm::dvec3 middle_of(std::span<const Camera> cameras) {
  glm::dvec3 sum(0.0);
  for (const Camera& camera : cameras) sum += camera.center();
  return sum / static_cast<double>(cameras.size());
}

// Mean of the directions along a straight edge.
glm::dvec3 mean_along(std::span<const Camera> cameras, const EdgePoint& point) {
  const glm::dvec3 along(-point.inward.y, point.inward.x, 0.0);
  glm::dvec3 sum(0.0);
  for (const Camera& camera : cameras) sum += glm::transpose(camera.rotation) * along;
  return sum / static_cast<double>(cameras.size());
}

// The axis of a cylinder is `axis`; a ball has none, and 0 stands there.
std::vector<Tangent> tangents_of(std::span<const Camera> cameras,
                                 std::span<const EdgePoint> edge,
                                 const glm::dvec3& axis) {
  const bool ball = axis == glm::dvec3(0.0);
  const glm::dvec3 middle = middle_of(cameras);
  std::vector<Tangent> out;
  for (const Camera& camera : cameras) {
    for (const EdgePoint& point : edge) {
      const auto through = [&](const glm::dvec2& place) {
        return camera_ray(camera, place.x, place.y);
      };
      const CameraRay ray = through(point.place), inner = through(point.place + point.inward);
      const CameraRay beside = through(point.place + glm::dvec2(-point.inward.y, point.inward.x));
      if (!ray.valid || !inner.valid || !beside.valid) continue;
      glm::dvec3 normal = glm::cross(ball ? beside.direction : axis, ray.direction);
      if (glm::dot(normal, inner.direction) < 0) normal = -normal;
      const double length = glm::length(normal);
      if (length > 0) out.push_back({ray.origin - middle, ray.direction, normal / length});
    }
  }
  return out;
}

}  // namespace

double outline_misfit(std::span<const Camera> cameras,
                      std::span<const EdgePoint> edge,
                      RoundBody shape) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  if (cameras.empty() || edge.empty()) return kNone;
  glm::dvec3 axis(0.0);
  if (shape == RoundBody::kCylinder) {
    axis = mean_along(cameras, edge.front());
    if (glm::length(axis) < kLeastParallel) return kNone;
  }
  // Least squares of n (c - e) = r over all planes with the normal n through the eye e, for the
  // centre c and the radius r. Along a cylinder c may lie anywhere.
  glm::dmat4 squares = glm::outerProduct(glm::dvec4(axis, 0.0), glm::dvec4(axis, 0.0));
  glm::dvec4 moments(0.0);
  const std::vector<Tangent> tangents = tangents_of(cameras, edge, axis);
  for (const Tangent& tangent : tangents) {
    const glm::dvec4 row(tangent.normal, -1.0);
    squares += glm::outerProduct(row, row);
    moments += row * glm::dot(tangent.normal, tangent.eye);
  }
  const glm::dvec4 body = glm::inverse(squares) * moments;
  const glm::dvec3 center(body);
  const double radius = body.w;
  if (!(radius > 0) || !std::isfinite(radius)) return kNone;
  double sum = 0;
  for (const Tangent& tangent : tangents) {
    const glm::dvec3 way = center - tangent.eye;
    if (!(glm::dot(way, tangent.ray) > 0)) return kNone;
    const double off = glm::dot(tangent.normal, way) - radius;
    sum += off * off;
  }
  return std::sqrt(sum / static_cast<double>(tangents.size())) / radius;
}

bool look_around(std::span<const Camera> cameras) {
  glm::dvec3 sum(0.0);
  for (const Camera& camera : cameras) sum += view_axis(camera);
  return glm::length(sum) < kMostParallel * static_cast<double>(cameras.size());
}

}  // namespace raysplats::io
