// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "raysplats/camera.hpp"

namespace raysplats {

/// Pixels of a picture whose sides are not negative.
inline std::size_t pixel_count(int width, int height) {
  return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
}

inline std::size_t pixel_count(const Camera& camera) {
  return pixel_count(camera.width, camera.height);
}

}  // namespace raysplats
