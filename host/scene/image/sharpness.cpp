// SPDX-License-Identifier: Apache-2.0
#include "scene/image/sharpness.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <numeric>
#include <vector>

namespace raysplats {
namespace {

constexpr int kCoarse = 24;  // pixels of the longer side of the reduced picture

/// The mean square of the Laplacian of a picture whose rows come one after the other.
class LaplacianMean {
 public:
  explicit LaplacianMean(int width) : width_(static_cast<std::size_t>(width)) {
    for (std::vector<double>& row : rows_) row.resize(width_);
  }

  /// Where the next row goes, which add() then takes.
  std::vector<double>& next() { return rows_[2]; }

  void add() {
    if (++count_ > 2) sum_ += squares_of_middle();
    std::rotate(rows_.begin(), rows_.begin() + 1, rows_.end());
  }

  /// Over all pixels; 0 for pictures that have none within.
  double mean() const {
    const std::size_t pixels = width_ * count_;
    return width_ < 3 || count_ < 3 ? 0.0 : sum_ / static_cast<double>(pixels);
  }

 private:
  double squares_of_middle() const {
    const std::vector<double>& middle = rows_[1];
    double sum = 0.0;
    for (std::size_t x = 1; x + 1 < width_; ++x) {
      const double laplacian =
          middle[x - 1] + middle[x + 1] + rows_[0][x] + rows_[2][x] - 4.0 * middle[x];
      sum += laplacian * laplacian;
    }
    return sum;
  }

  std::size_t width_;
  std::size_t count_ = 0;
  std::array<std::vector<double>, 3> rows_;
  double sum_ = 0.0;
};

}  // namespace

Sharpness sharpness(int width, int height, const BrightnessRow& read) {
  // Squares of so many pixels; what is left over at two sides belongs to none.
  const int side = std::max(2, std::max(width, height) / kCoarse);
  LaplacianMean fine(width), coarse(width / side);
  for (int y = 0; y < height; ++y) {
    std::vector<double>& row = fine.next();
    read(y, row.data());
    std::vector<double>& sums = coarse.next();
    if (y % side == 0) std::fill(sums.begin(), sums.end(), 0.0);
    for (std::size_t k = 0; k < sums.size(); ++k) {
      const auto first = row.begin() + static_cast<std::ptrdiff_t>(k) * side;
      sums[k] += std::accumulate(first, first + side, 0.0) / (side * side);
    }
    if (y % side == side - 1) coarse.add();
    fine.add();
  }
  return {fine.mean(), coarse.mean()};
}

Sharpness sharpness(const Image& image) {
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
