// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <glm/vec2.hpp>

#include "train/start/photo_set.hpp"

namespace raysplats {

/// Square cells of a photo, as far as they lie inside.
class PhotoCells {
 public:
  PhotoCells(const SmallPhoto& photo, int side)
      : side_(side),
        columns_((photo.camera.width + side - 1) / side),
        rows_((photo.camera.height + side - 1) / side) {}

  std::size_t count() const {
    return static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_);
  }

  /// The one that contains the image point, which has to lie inside.
  std::size_t at(const glm::dvec2& place) const {
    const auto along = [this](double x, int cells) {
      return static_cast<std::size_t>(std::min(static_cast<int>(x) / side_, cells - 1));
    };
    return along(place.y, rows_) * static_cast<std::size_t>(columns_) + along(place.x, columns_);
  }

 private:
  int side_, columns_, rows_;
};

}  // namespace raysplats
