// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <string>

#include "raysplats/error.hpp"

namespace raysplats::io {

/// Most pixels along a side, and of a picture.
constexpr int kMaxImageSide = 32768;
constexpr std::uint64_t kMaxImagePixels = std::uint64_t{1} << 28;

/// Throws DataError for a picture without pixels or with more than these.
inline void require_bearable_size(const std::string& name,
                                  std::int64_t width,
                                  std::int64_t height) {
  if (width < 1 || height < 1)
    throw DataError(fmt::format("The image {} is not a flat picture with pixels", name));
  if (width > kMaxImageSide || height > kMaxImageSide ||
      static_cast<std::uint64_t>(width) * static_cast<std::uint64_t>(height) > kMaxImagePixels) {
    throw DataError(fmt::format(
        "The image {} has {} x {} pixels, more than {} a side or {} million: make it smaller", name,
        width, height, kMaxImageSide, kMaxImagePixels >> 20));
  }
}

}  // namespace raysplats::io
