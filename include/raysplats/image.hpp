// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

namespace raysplats {

/// Row-major interleaved float image; 8-bit files hold value * 255 (no gamma is applied in or out).
struct Image {
  int width = 0;            ///< pixels
  int height = 0;           ///< pixels
  int channels = 0;         ///< numbers of a pixel
  std::vector<float> data;  ///< height x width x channels

  Image() = default;
  /// Every number is `value`.
  Image(int w, int h, int c, float value = 0.0f)
      : width(w),
        height(h),
        channels(c),
        data(
            static_cast<std::size_t>(w) * static_cast<std::size_t>(h) * static_cast<std::size_t>(c),
            value) {}
  /// Channel c of the pixel in column x and row y, which are not checked.
  float& at(int x, int y, int c) { return data[index(x, y, c)]; }
  float at(int x, int y, int c) const { return data[index(x, y, c)]; }
  /// width x height.
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
