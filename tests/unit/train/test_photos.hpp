// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <memory>
#include <vector>

#include "scene/camera/camera_model.hpp"
#include "train/start/photo_set.hpp"
#include "train/start/point_cloud.hpp"
#include "util/rng.hpp"

namespace raysplats::test {

/// Cameras around the target, a little above it, that look at it.
inline std::vector<Camera> ring(int count, double radius, const glm::dvec3& target) {
  std::vector<Camera> cameras;
  for (int i = 0; i < count; ++i) {
    const double angle = 2 * 3.14159265358979 * i / count;
    const glm::dvec3 eye = target + radius * glm::dvec3(std::cos(angle), std::sin(angle), 0.4);
    cameras.push_back(look_at(eye, target, {0, 0, 1}, 80, 100, 160));
  }
  return cameras;
}

/// A rig of eight lenses, 45 degrees apart, in so many places of a line: place by place, as
/// pictures are named.
inline std::vector<Camera> rig_of_eight(int places) {
  std::vector<Camera> cameras;
  for (int i = 0; i < 8 * places; ++i) {
    const double angle = 2 * 3.14159265358979 * (i % 8) / 8;
    const glm::dvec3 eye(0.1 * (i / 8), 0, 0);
    cameras.push_back(
        look_at(eye, eye + glm::dvec3(std::cos(angle), std::sin(angle), 0), {0, 0, 1}, 40, 32, 35));
  }
  return cameras;
}

/// The photo that `color` of each pixel's ray makes.
template <class Color>
SmallPhoto photo_of(const Camera& camera, const Color& color) {
  auto picture = std::make_shared<io::Photo>();
  picture->width = camera.width;
  picture->height = camera.height;
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const CameraRay ray = camera_ray(camera, x + 0.5, y + 0.5);
      const glm::dvec4 c = color(ray);
      std::uint32_t pixel = 0;
      for (int k = 0; k < 4; ++k)
        pixel |= static_cast<std::uint32_t>(std::lround(255 * std::clamp(c[k], 0.0, 1.0))) << 8 * k;
      picture->words.push_back(pixel);
    }
  }
  return {camera, picture};
}

/// A wall at x = 4 with a pattern that does not repeat within a pixel's neighbourhood.
inline glm::dvec4 wall(const CameraRay& ray) {
  const double t = (4.0 - ray.origin.x) / ray.direction.x;
  const glm::dvec3 p = ray.origin + t * ray.direction;
  return {0.5 + 0.4 * std::sin(3.1 * p.y + 0.7 * p.z) * std::sin(1.3 * p.z),
          0.5 + 0.4 * std::cos(2.3 * p.z - 1.1 * p.y), 0.5 + 0.4 * std::sin(4.7 * p.y - 2.9 * p.z),
          1.0};
}

/// 4000 points on the wall, with its colours, wherever it is lower than `top`.
inline PointCloud points_below(double top) {
  CounterRng rng(4, 1);
  PointCloud out;
  while (out.size() < 4000) {
    const glm::dvec3 p(4.0, 6.0 * rng.uniform() - 3.0, 6.0 * rng.uniform() - 3.0);
    if (p.z < top) append_point(out, p, glm::dvec3(wall({{0, 0, 0}, p / 4.0, true})));
  }
  return out;
}

/// Photos of the wall from nine places before it.
inline std::vector<SmallPhoto> photos_of_wall() {
  std::vector<SmallPhoto> out;
  for (int i = 0; i < 9; ++i) {
    const double y = 0.4 * (i % 3 - 1), z = 0.4 * (i / 3 - 1);
    out.push_back(photo_of(look_at({0, y, z}, {4, 0.5 * y, 0.5 * z}, {0, 0, 1}, 96, 72, 90), wall));
  }
  return out;
}

}  // namespace raysplats::test
