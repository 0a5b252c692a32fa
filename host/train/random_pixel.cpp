// SPDX-License-Identifier: Apache-2.0
#include "train/random_pixel.hpp"

namespace raysplats {

RandomPixel random_pixel(std::span<const SmallPhoto> photos, CounterRng& rng) {
  RandomPixel out;
  out.view = rng.below(photos.size());
  const SmallPhoto& photo = photos[out.view];
  out.point.y = rng.uniform() * photo.camera.height;
  out.point.x = rng.uniform() * photo.camera.width;
  out.ray = camera_ray(photo.camera, out.point.x, out.point.y);
  out.color = photo.at(out.point);
  return out;
}

}  // namespace raysplats
