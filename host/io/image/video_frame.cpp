// SPDX-License-Identifier: Apache-2.0
#include "io/image/video_frame.hpp"

#include <fmt/format.h>

#include "io/image/display_byte.hpp"
#include "io/image/side_limits.hpp"
#include "raysplats/error.hpp"

namespace raysplats {

void FrameSize::require(const Image& frame, const std::filesystem::path& video) {
  if (width == 0) {
    io::require_writable_size(video, frame.width, frame.height);
    width = frame.width;
    height = frame.height;
  }
  if (frame.width == width && frame.height == height) return;
  throw UsageError(fmt::format(
      "The video {} begins with {} x {} pixels, and a frame has {} x {}: its cameras need one size",
      video.string(), width, height, frame.width, frame.height));
}

std::vector<std::uint8_t> rgb_bytes(const Image& frame) {
  std::vector<std::uint8_t> bytes;
  bytes.reserve(3 * frame.pixels());
  for (std::size_t i = 0; i < frame.pixels(); ++i) {
    for (std::size_t c = 0; c < 3; ++c)
      bytes.push_back(display_byte(frame.data[i * static_cast<std::size_t>(frame.channels) + c]));
  }
  return bytes;
}

}  // namespace raysplats
