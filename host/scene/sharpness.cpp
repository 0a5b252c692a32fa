// SPDX-License-Identifier: Apache-2.0
#include "scene/sharpness.hpp"

#include <algorithm>

namespace raysplats {
namespace {

double brightness(const Image& image, int x, int y) {
  double sum = 0.0;
  const int colors = std::min(image.channels, 3);
  for (int c = 0; c < colors; ++c) sum += static_cast<double>(image.at(x, y, c));
  return sum / colors;
}

}  // namespace

double sharpness(const Image& image) {
  double sum = 0.0;
  for (int y = 1; y + 1 < image.height; ++y) {
    for (int x = 1; x + 1 < image.width; ++x) {
      const double laplacian = brightness(image, x - 1, y) + brightness(image, x + 1, y) +
                               brightness(image, x, y - 1) + brightness(image, x, y + 1) -
                               4.0 * brightness(image, x, y);
      sum += laplacian * laplacian;
    }
  }
  return sum / std::max<double>(1.0, static_cast<double>(image.pixels()));
}

}  // namespace raysplats
