// SPDX-License-Identifier: Apache-2.0
#include "eval/error_map.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

void check_sizes(const Image& a, const Image& b) {
  if (a.width != b.width || a.height != b.height || a.channels < 3 || b.channels < 3) {
    throw UsageError(fmt::format(
        "An error map compares RGB images of equal size; these are {}x{}x{} and {}x{}x{}", a.width,
        a.height, a.channels, b.width, b.height, b.channels));
  }
}

// The error map of both into `out`, from column `left` on.
void write_error_map(
    const Image& image, const Image& photo, float full_scale, Image& out, int left) {
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      float sum = 0;
      for (int c = 0; c < 3; ++c) sum += std::abs(image.at(x, y, c) - photo.at(x, y, c));
      const float level =
          sum / full_scale;  // 3 at full scale: each channel takes one third of the range
      for (int c = 0; c < 3; ++c)
        out.at(left + x, y, c) = std::clamp(level - static_cast<float>(c), 0.0f, 1.0f);
    }
  }
}

}  // namespace

Image error_map(const Image& image, const Image& photo, float full_scale) {
  check_sizes(image, photo);
  Image out(image.width, image.height, 3);
  write_error_map(image, photo, full_scale, out, 0);
  return out;
}

Image side_by_side(const Image& photo, const Image& render) {
  check_sizes(render, photo);
  Image out(3 * photo.width, photo.height, 3);
  const Image* parts[] = {&photo, &render};
  for (int part = 0; part < 2; ++part) {
    for (int y = 0; y < photo.height; ++y) {
      for (int x = 0; x < photo.width; ++x) {
        for (int c = 0; c < 3; ++c) out.at(part * photo.width + x, y, c) = parts[part]->at(x, y, c);
      }
    }
  }
  write_error_map(render, photo, kErrorScale, out, 2 * photo.width);
  return out;
}

}  // namespace raysplats
