// SPDX-License-Identifier: Apache-2.0
#include "scene/image/sharpness.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

namespace raysplats {
namespace {

/// Sum of the squares of the Laplacian along the middle one of three rows.
double squares_of_middle(const std::array<std::vector<double>, 3>& rows) {
  const std::vector<double>& middle = rows[1];
  double sum = 0.0;
  for (std::size_t x = 1; x + 1 < middle.size(); ++x) {
    const double laplacian =
        middle[x - 1] + middle[x + 1] + rows[0][x] + rows[2][x] - 4.0 * middle[x];
    sum += laplacian * laplacian;
  }
  return sum;
}

}  // namespace

double sharpness(int width, int height, const BrightnessRow& read) {
  if (width < 3 || height < 3) return 0.0;
  std::array<std::vector<double>, 3> rows;
  for (std::vector<double>& row : rows) row.resize(static_cast<std::size_t>(width));
  double sum = 0.0;
  for (int y = 0; y < height; ++y) {
    read(y, rows[2].data());
    if (y > 1) sum += squares_of_middle(rows);
    std::rotate(rows.begin(), rows.begin() + 1, rows.end());
  }
  return sum / (static_cast<double>(width) * height);
}

double sharpness(const Image& image) {
  const int colors = std::min(image.channels, 3);
  return sharpness(image.width, image.height, [&](int y, double* row) {
    for (int x = 0; x < image.width; ++x) {
      double sum = 0.0;
      for (int c = 0; c < colors; ++c) sum += static_cast<double>(image.at(x, y, c));
      row[x] = sum / colors;
    }
  });
}

}  // namespace raysplats
