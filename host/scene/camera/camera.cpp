// SPDX-License-Identifier: Apache-2.0
#include "raysplats/camera.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>
#include <limits>

#include "raysplats/error.hpp"

namespace raysplats {

Camera downscaled(const Camera& camera, double factor) {
  const double side = std::max(camera.width, camera.height) / factor;
  // Written so that NaN is refused.
  if (!(factor > 0.0) || !(side <= std::numeric_limits<int>::max())) {
    throw UsageError(
        fmt::format("Camera '{}' of {} x {} pixels cannot be downscaled by {}: give a positive "
                    "factor that leaves a size",
                    camera.name, camera.width, camera.height, factor));
  }
  Camera out = camera;
  out.width = std::max(1, static_cast<int>(std::lround(camera.width / factor)));
  out.height = std::max(1, static_cast<int>(std::lround(camera.height / factor)));
  // Rounded sizes change the two axes by slightly different factors; the field of view stays.
  // Distortion acts on normalised coordinates, which do not change.
  const double sx = static_cast<double>(out.width) / camera.width;
  const double sy = static_cast<double>(out.height) / camera.height;
  out.fx *= sx;
  out.cx *= sx;
  out.fy *= sy;
  out.cy *= sy;
  return out;
}

Camera moved(const Camera& camera, const glm::dvec3& turn, const glm::dvec3& shift) {
  Camera out = camera;
  const glm::dvec3 center = out.center() + shift;
  const double angle = glm::length(turn);
  if (angle != 0.0)
    out.rotation = glm::mat3_cast(glm::angleAxis(angle, turn / angle)) * out.rotation;
  out.translation = -(out.rotation * center);
  return out;
}

Camera look_at(const glm::dvec3& eye,
               const glm::dvec3& target,
               const glm::dvec3& up,
               int width,
               int height,
               double focal) {
  const glm::dvec3 view = target - eye;
  const double upwards = glm::length(up);
  // Also where a square leaves double precision.
  if (!std::isnormal(glm::dot(view, view)) || !std::isfinite(upwards) || !std::isfinite(focal)) {
    throw UsageError(fmt::format(
        "A camera at ({}, {}, {}) cannot look at ({}, {}, {}) with ({}, {}, {}) upwards and a "
        "focal length of {}: give finite numbers and a target apart from the camera",
        eye.x, eye.y, eye.z, target.x, target.y, target.z, up.x, up.y, up.z, focal));
  }
  const glm::dvec3 forward = glm::normalize(view);
  glm::dvec3 right = glm::cross(forward, up);
  // Looking along `up` leaves the roll open: any perpendicular will do.
  if (glm::length(right) <= 1e-9 * upwards) {
    right =
        glm::cross(forward, std::abs(forward.x) < 0.9 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0));
  }
  right = glm::normalize(right);
  const glm::dvec3 down = glm::cross(forward, right);
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = focal;
  camera.cx = width / 2.0;
  camera.cy = height / 2.0;
  camera.rotation = glm::transpose(glm::dmat3(right, down, forward));
  camera.translation = -(camera.rotation * eye);
  return camera;
}

}  // namespace raysplats
