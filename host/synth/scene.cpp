// SPDX-License-Identifier: Apache-2.0
#include "synth/scene.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <numbers>
#include <utility>

namespace raysplats::synth {

namespace {

const glm::dvec3 kLampCenter{2.1, -1.7, 3.6};
constexpr double kLampRadius = 0.35;
const glm::dvec3 kLampColor{0.95, 0.90, 0.82};
const glm::dvec3 kSkyColor{0.40, 0.43, 0.48};
const glm::dvec3 kFloorColor{0.16, 0.14, 0.12};
/// Distance by which shadow rays leave the surface, above the tolerance of sphere tracing.
constexpr double kShadowOffset = 3e-4;
constexpr double kSceneRadius = 1.25;

}  // namespace

Scene::Scene(std::vector<Object> objects, Backdrop backdrop)
    : objects_(std::move(objects)),
      backdrop_(std::move(backdrop)),
      whole_{glm::dvec3(0.0), kSceneRadius * kSceneRadius} {
  for (const Object& object : objects_) {
    const double radius = object.shape->bound_radius();
    bounds_.push_back({object.shape->bound_center(), radius * radius});
  }
  const glm::dmat3 frame = frame_along(kLampCenter);
  for (int j = 0; j < kLampGrid; ++j) {
    for (int i = 0; i < kLampGrid; ++i) {
      // Equal areas of the disc: radius by the square root, angle by the cell.
      const double radius = kLampRadius * std::sqrt((j + 0.5) / kLampGrid);
      const double angle = 2.0 * std::numbers::pi * (i + 0.5 * (j % 2)) / kLampGrid;
      lamp_points_.push_back(kLampCenter +
                             radius * (std::cos(angle) * frame[0] + std::sin(angle) * frame[1]));
    }
  }
}

bool Scene::may_meet(const Bound& bound, const Ray& ray) const {
  const glm::dvec3 to_center = bound.center - ray.origin;
  const double along = glm::dot(to_center, ray.direction);
  const double squared = glm::dot(to_center, to_center);
  if (squared - along * along > bound.squared_radius) return false;
  return along > 0.0 || squared < bound.squared_radius;
}

bool Scene::occluded(const Ray& ray) const {
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    // The lamp is outside the scene, so any hit lies before it.
    if (may_meet(bounds_[i], ray) && objects_[i].shape->intersect(ray) < kMiss) return true;
  }
  return false;
}

glm::dvec3 Scene::shade(const Object& object,
                        const glm::dvec3& point,
                        const glm::dvec3& to_eye,
                        int lamp_sample) const {
  glm::dvec3 normal = object.shape->normal(point);
  if (glm::dot(normal, to_eye) < 0.0) normal = -normal;
  const Material& material = object.material;
  const glm::dvec3 albedo = material.albedo(object.shape->local(point));
  const double up = 0.5 + 0.5 * normal.z;
  glm::dvec3 color = albedo * (kFloorColor + up * (kSkyColor - kFloorColor));

  const glm::dvec3 to_lamp =
      glm::normalize(lamp_points_[static_cast<std::size_t>(lamp_sample)] - point);
  const double facing = glm::dot(normal, to_lamp);
  const double diffuse = facing >= 0.0 ? facing : -facing * material.translucency;
  if (diffuse <= 0.0) return color;
  const glm::dvec3 start = point + (facing >= 0.0 ? kShadowOffset : -kShadowOffset) * normal;
  if (occluded({start, to_lamp})) return color;
  color += albedo * kLampColor * diffuse;
  if (facing > 0.0 && material.specular > 0.0) {
    const double shine = std::max(0.0, glm::dot(normal, glm::normalize(to_lamp + to_eye)));
    color += kLampColor * (material.specular * std::pow(shine, material.exponent));
  }
  return color;
}

Scene::Sample Scene::behind(const Ray& ray) const {
  if (!backdrop_) return {};
  return {.color = backdrop_(ray), .alpha = 1.0};
}

Scene::Sample Scene::trace(const Ray& ray, int lamp_sample) const {
  if (!may_meet(whole_, ray)) return behind(ray);
  double nearest = kMiss;
  const Object* hit = nullptr;
  for (std::size_t i = 0; i < objects_.size(); ++i) {
    if (!may_meet(bounds_[i], ray)) continue;
    const double t = objects_[i].shape->intersect(ray);
    if (t < nearest) {
      nearest = t;
      hit = &objects_[i];
    }
  }
  if (hit == nullptr) return behind(ray);
  const glm::dvec3 linear =
      shade(*hit, ray.origin + nearest * ray.direction, -ray.direction, lamp_sample);
  // The square root stands for the transfer curve of a display.
  Sample sample{.color = {}, .alpha = 1.0};
  for (int c = 0; c < 3; ++c) sample.color[c] = std::sqrt(std::clamp(linear[c], 0.0, 1.0));
  return sample;
}

Image render(const Scene& scene, const Camera& camera) {
  constexpr int kGrid = Scene::kLampGrid;
  const glm::dmat3 to_world = glm::transpose(camera.rotation);
  const glm::dvec3 eye = camera.center();
  Image image(camera.width, camera.height, 4);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      glm::dvec3 color(0.0);
      double alpha = 0.0;
      for (int sample = 0; sample < kGrid * kGrid; ++sample) {
        const int row_of_grid = sample / kGrid;
        const double column = x + (sample % kGrid + 0.5) / kGrid;
        const double row = y + (row_of_grid + 0.5) / kGrid;
        const glm::dvec3 direction((column - camera.cx) / camera.fx, (row - camera.cy) / camera.fy,
                                   1.0);
        // The stride (prime to the number of samples) mixes lamp points over the pixel.
        const Scene::Sample traced = scene.trace({eye, glm::normalize(to_world * direction)},
                                                 (sample * 4 + 1) % Scene::kLampSamples);
        color += traced.alpha * traced.color;
        alpha += traced.alpha;
      }
      if (alpha == 0.0) continue;
      for (int c = 0; c < 3; ++c) image.at(x, y, c) = static_cast<float>(color[c] / alpha);
      image.at(x, y, 3) = static_cast<float>(alpha / (kGrid * kGrid));
    }
  }
  return image;
}

}  // namespace raysplats::synth
