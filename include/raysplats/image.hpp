// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

namespace raysplats {

/// Row-major interleaved float image; 8-bit files hold value * 255 (no gamma is applied in or out).
struct Image {
  int width = 0;
  int height = 0;
  int channels = 0;
  std::vector<float> data;  ///< height x width x channels

  Image() = default;
  Image(int w, int h, int c, float value = 0.0f)
      : width(w),
        height(h),
        channels(c),
        data(
            static_cast<std::size_t>(w) * static_cast<std::size_t>(h) * static_cast<std::size_t>(c),
            value) {}
  float& at(int x, int y, int c) { return data[index(x, y, c)]; }
  float at(int x, int y, int c) const { return data[index(x, y, c)]; }
  std::size_t pixels() const {
    return static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  }

 private:
  std::size_t index(int x, int y, int c) const {
    return (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
            static_cast<std::size_t>(x)) *
               static_cast<std::size_t>(channels) +
           static_cast<std::size_t>(c);
  }
};

}  // namespace raysplats
