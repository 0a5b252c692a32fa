// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "raysplats/image.hpp"

namespace raysplats {

/// The size of a video's frames, that of the first.
struct FrameSize {
  int width = 0;
  int height = 0;
  /// Throws UsageError for a frame of another size or beyond what the video's format holds.
  void require(const Image& frame, const std::filesystem::path& video);
};

/// R, G, B with 8 bits each, row by row from the top; values are clamped to [0, 1], NaN is 0.
std::vector<std::uint8_t> rgb_bytes(const Image& frame);

}  // namespace raysplats
