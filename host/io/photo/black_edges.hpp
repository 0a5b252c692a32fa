// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <glm/vec2.hpp>
#include <optional>
#include <vector>

#include "io/image/image_codec.hpp"
#include "raysplats/dataset.hpp"

namespace raysplats::io {

enum PhotoSide : std::size_t { kTop, kBottom, kLeft, kRight };
inline constexpr std::size_t kPhotoSides = 4;

/// Black at an edge is a border from so many pixels on.
inline constexpr int kLeastBorder = 2;

/// How far a photo on disk, or what several have in common, is black from each edge.
struct BlackEdges {
  int width = 0;                                     ///< of the photo, pixels
  int height = 0;                                    ///< of the photo, pixels
  std::array<std::vector<int>, kPhotoSides> depths;  ///< pixels, by column or row

  /// The depth at which all of the photo is black.
  int depth_of(PhotoSide side) const { return side == kTop || side == kBottom ? height : width; }
  bool is_black() const;
  /// Where something begins behind what is black: image points.
  std::vector<glm::dvec2> ends() const;
};

/// Nothing where the photo cannot be read: who needs it says what is wrong with it.
std::optional<BlackEdges> black_edges(const View& view);

/// The share of what `where` takes of the view's photo that is not black.
double shown_share(const RawImage& photo, const View& view, const PhotoBorder& where);

}  // namespace raysplats::io
