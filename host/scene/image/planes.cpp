// SPDX-License-Identifier: Apache-2.0
#include "scene/image/planes.hpp"

#include <cstddef>

namespace raysplats {

Image interleaved(const std::vector<float>& planes, int width, int height, int channels) {
  Image out(width, height, channels);
  const std::size_t pixels = out.pixels();
  const auto n = static_cast<std::size_t>(channels);
  for (std::size_t c = 0; c < n; ++c) {
    for (std::size_t i = 0; i < pixels; ++i) out.data[i * n + c] = planes[c * pixels + i];
  }
  return out;
}

std::vector<float> planes_of(const Image& image) {
  std::vector<float> planes(image.data.size());
  const std::size_t pixels = image.pixels();
  const auto n = static_cast<std::size_t>(image.channels);
  for (std::size_t c = 0; c < n; ++c) {
    for (std::size_t i = 0; i < pixels; ++i) planes[c * pixels + i] = image.data[i * n + c];
  }
  return planes;
}

}  // namespace raysplats
