// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "raysplats/dataset.hpp"
#include "scene/image/pixel_count.hpp"
#include "scene/image/sharpness.hpp"

namespace raysplats::io {

/// The photo of a view as the loss reads it on the device (cl/train/photo.h), with the precision of
/// its file: 8 bits a channel stay 8 bits.
struct Photo {
  int width = 0;
  int height = 0;
  int planes = 1;         ///< words a pixel: 1 (8 bits), 2 (16 bits) or 4 (floats)
  bool weighted = false;  ///< a plane of weights follows (View::mask_apart)
  std::vector<std::uint32_t> words;

  std::size_t pixels() const { return pixel_count(width, height); }
  std::size_t bytes() const { return words.size() * sizeof(std::uint32_t); }
  /// Straight RGBA of a pixel, in [0, 1].
  std::array<float, 4> at(int x, int y) const;
  /// How much it counts.
  float weight(int x, int y) const;
};

/// sharpness() of the photo over black.
Sharpness sharpness(const Photo& photo);

/// What load_photo() will take.
std::size_t photo_bytes(const View& view);

/// load_view_picture() rounded to the precision of the file, once. Throws as that does.
Photo load_photo(const View& view);

}  // namespace raysplats::io
