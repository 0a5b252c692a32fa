// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <bit>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "scene/image/pixel_count.hpp"

namespace raysplats {

/// Some of the pixels of a picture, a bit each, row by row, the first one the lowest of a word.
struct PixelMask {
  int width = 0;
  int height = 0;
  std::vector<std::uint32_t> words;

  PixelMask() = default;
  PixelMask(int columns, int rows)
      : width(columns), height(rows), words((pixel_count(columns, rows) + 31) / 32) {}

  bool operator[](std::size_t pixel) const { return (words[pixel / 32] >> (pixel % 32) & 1u) != 0; }
  void set(std::size_t pixel) { words[pixel / 32] |= 1u << (pixel % 32); }
  bool operator==(const PixelMask&) const = default;
};

/// How many pixels there are.
inline std::size_t count(const PixelMask& mask) {
  std::size_t out = 0;
  for (const std::uint32_t word : mask.words) out += static_cast<std::size_t>(std::popcount(word));
  return out;
}

/// Their share of the picture; 0 of one without pixels.
inline double marked_share(const PixelMask& mask) {
  const std::size_t pixels = pixel_count(mask.width, mask.height);
  return pixels > 0 ? static_cast<double>(count(mask)) / static_cast<double>(pixels) : 0.0;
}

}  // namespace raysplats
