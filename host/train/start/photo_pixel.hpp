// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <glm/vec2.hpp>
#include <glm/vec4.hpp>
#include <span>

#include "scene/camera/camera_model.hpp"
#include "train/start/photo_set.hpp"
#include "util/rng.hpp"

namespace raysplats {

/// A place in a photo, and what is there.
struct PhotoPixel {
  std::size_t view = 0;
  glm::dvec2 point;  ///< in pixels
  CameraRay ray;
  glm::dvec4 color;  ///< and alpha

  /// Whether the photo shows something there that counts.
  bool shows() const { return ray.valid && color.w >= 0.5; }
};

/// What a photo shows at a point inside it.
PhotoPixel pixel_at(std::span<const SmallPhoto> photos, std::size_t view, const glm::dvec2& point);

/// A random place in a random photo. Draws three numbers; `photos` is not empty.
PhotoPixel random_pixel(std::span<const SmallPhoto> photos, CounterRng& rng);

}  // namespace raysplats
