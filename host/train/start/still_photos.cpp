// SPDX-License-Identifier: Apache-2.0
#include "train/start/still_photos.hpp"

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <map>
#include <optional>
#include <utility>

#include "scene/camera/camera_model.hpp"
#include "train/capture_geometry.hpp"
#include "train/start/depth_range.hpp"

namespace raysplats {
namespace {

// What may be a thing of the scene is seen within so much of the longer side, in half of the
// photos, at one of so many depths from near to far, in extents.
constexpr double kNearPlace = 0.015;
constexpr double kSeenThere = 0.5;
constexpr std::size_t kDepths = 200;
constexpr double kNearest = 0.01, kFarthest = 1e4;

}  // namespace

std::vector<SmallPhoto> of_one_size(std::span<const SmallPhoto> photos) {
  std::map<std::pair<int, int>, std::vector<SmallPhoto>> sizes;
  for (const SmallPhoto& photo : photos)
    sizes[{photo.picture->width, photo.picture->height}].push_back(photo);
  if (sizes.empty()) return {};
  return std::max_element(
             sizes.begin(), sizes.end(),
             [](const auto& a, const auto& b) { return a.second.size() < b.second.size(); })
      ->second;
}

double extent_of(std::span<const SmallPhoto> photos) {
  std::vector<Camera> cameras;
  cameras.reserve(photos.size());
  for (const SmallPhoto& photo : photos) cameras.push_back(photo.camera);
  return camera_extent(cameras);
}

glm::vec2 step_at(const io::Photo& photo, int x, int y, std::size_t channel) {
  const auto value = [&](int i, int j) -> std::optional<float> {
    const std::array<float, 4> rgba = photo.at(i, j);
    if (rgba[3] < 0.5f || photo.weight(i, j) < 0.5f) return std::nullopt;
    return rgba[channel];
  };
  const auto left = value(x - 1, y), right = value(x + 1, y);
  const auto above = value(x, y - 1), below = value(x, y + 1);
  // What masks leave out tells of no edge.
  if (!left || !right || !above || !below) return glm::vec2(0.0f);
  return {*right - *left, *below - *above};
}

bool may_be_seen(std::span<const SmallPhoto> photos, const glm::dvec2& place, double extent) {
  const CameraRay ray = camera_ray(photos.front().camera, place.x, place.y);
  if (!ray.valid) return true;
  const Camera& camera = photos.front().camera;
  const double near = kNearPlace * std::max(camera.width, camera.height);
  const DepthRange depths{kNearest * extent, extent, kFarthest * extent, false};
  for (std::size_t step = 0; step < kDepths; ++step) {
    const glm::dvec3 world = ray.origin + depths.at(step, kDepths) * ray.direction;
    std::size_t there = 0;
    for (const SmallPhoto& photo : photos) {
      const auto seen = photo.sees(world);
      there += seen && glm::distance(*seen, place) <= near ? 1 : 0;
    }
    if (static_cast<double>(there) >= kSeenThere * static_cast<double>(photos.size())) return true;
  }
  return false;
}

}  // namespace raysplats
