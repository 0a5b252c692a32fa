// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "raysplats/image.hpp"

namespace raysplats::view {

/// What is said of a picture in front of its bytes.
struct PictureHeader {
  std::uint32_t view = 0;     ///< ViewRequest::id
  std::uint32_t samples = 0;  ///< per pixel so far
  bool last = false;          ///< nothing better follows
  bool png = false;
  std::int64_t iteration = 0;  ///< of the model
  float milliseconds = 0;      ///< that the newest sample took
};

/// Bytes of the header in the message: "RSVF", then little-endian view, width, height, samples,
/// flags (1 = last, 2 = PNG), iteration and milliseconds (float), 4 bytes each.
constexpr std::size_t kPictureHeader = 32;

/// The message of a picture: header and JPEG of this quality, or PNG. RGB of `rgba` is clamped to
/// 0..1. Throws as the library of pictures.
std::vector<std::byte> picture_message(const PictureHeader& header, const Image& rgba, int quality);

}  // namespace raysplats::view
