// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <bit>
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
  /// Straight RGBA of a pixel, in [0, 1]. Defined here: starts look up millions.
  std::array<float, 4> at(int x, int y) const {
    const std::uint32_t* word = words.data() +
                                static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                                static_cast<std::size_t>(x);
    const auto part = [](std::uint32_t value, int shift, std::uint32_t mask) {
      return static_cast<float>(value >> shift & mask) / static_cast<float>(mask);
    };
    if (planes == 1) {
      return {part(*word, 0, 255), part(*word, 8, 255), part(*word, 16, 255), part(*word, 24, 255)};
    }
    const std::size_t plane = pixels();
    if (planes == 2) {
      return {part(word[0], 0, 65535), part(word[0], 16, 65535), part(word[plane], 0, 65535),
              part(word[plane], 16, 65535)};
    }
    std::array<float, 4> out{};
    for (std::size_t c = 0; c < 4; ++c) out[c] = std::bit_cast<float>(word[c * plane]);
    return out;
  }
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
