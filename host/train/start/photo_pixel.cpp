// SPDX-License-Identifier: Apache-2.0
#include "train/start/photo_pixel.hpp"

namespace raysplats {

PhotoPixel pixel_at(std::span<const SmallPhoto> photos, std::size_t view, const glm::dvec2& point) {
  const SmallPhoto& photo = photos[view];
  return {view, point, camera_ray(photo.camera, point.x, point.y), photo.at(point)};
}

PhotoPixel random_pixel(std::span<const SmallPhoto> photos, CounterRng& rng) {
  const std::size_t view = rng.below(photos.size());
  const Camera& camera = photos[view].camera;
  glm::dvec2 point;
  point.y = rng.uniform() * camera.height;
  point.x = rng.uniform() * camera.width;
  return pixel_at(photos, view, point);
}

}  // namespace raysplats
