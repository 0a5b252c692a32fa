// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <glm/vec2.hpp>
#include <span>
#include <vector>

#include "train/start/photo_set.hpp"

namespace raysplats {

/// Photos that tell of marks, and their longer side, in pixels.
inline constexpr std::size_t kMarkPhotos = 16;
inline constexpr int kMarkSide = 400;

/// A place that looks the same in all photos: a box of pixels.
struct StillMark {
  glm::ivec2 low{0}, high{0};  ///< its first and its last pixel
  std::size_t edges = 0;       ///< pixels on its edges
  glm::ivec2 size{0};          ///< of the photos that have it
};

/// What stands at the same pixels of most photos and is no part of the scene, as a logo, a date or
/// what a drone shows over its picture; the most edges first. Told by edges that have one direction
/// and some strength in nine of ten photos (the median gradient of Dekel et al. 2017), close
/// together and facing all sides. None is what may be a thing of the scene: what is large, and what
/// lies where the cameras' rays through these pixels meet (what all look at, or far away from
/// cameras that do not turn). At least twelve photos of one size tell.
std::vector<StillMark> still_marks(std::span<const SmallPhoto> photos);

/// The box of a photo on disk, taken by `photo`, that holds a mark of its pictures, which `picture`
/// has taken (of StillMark::size), with a rim for what is faint. In thousandths of its sides.
PhotoArea area_of(const StillMark& mark, const Camera& picture, const Camera& photo);

}  // namespace raysplats
