// SPDX-License-Identifier: Apache-2.0
#include "eval/shift_fit.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <vector>

#include "util/parallel.hpp"

namespace raysplats {
namespace {

constexpr int kCoarsest = 48;       // pixels of the longer side from which reduced pictures end
constexpr int kSteps = 4;           // at each size at most
constexpr double kSettled = 0.01;   // pixels of a step after which none follows at its size
constexpr double kLongest = 1.0;    // pixels a step, where a picture is nearly linear
constexpr double kFarthest = 0.05;  // of the longer side
constexpr std::size_t kRows = 16;   // a chunk of rows whose sums are added in order

// A picture, its photo and how much each pixel counts, one channel each.
struct Pair {
  Image picture, photo, weight;
};

Image brightness(const Image& image) {
  Image out(image.width, image.height, 1);
  for (std::size_t p = 0; p < out.pixels(); ++p) {
    float sum = 0;
    for (std::size_t c = 0; c < 3; ++c) sum += image.data[3 * p + c];
    out.data[p] = sum / 3.0f;
  }
  return out;
}

// Of squares of four pixels; a last row or column that has none is left out.
Image halved(const Image& image) {
  Image out(image.width / 2, image.height / 2, 1);
  for (int y = 0; y < out.height; ++y) {
    for (int x = 0; x < out.width; ++x) {
      out.at(x, y, 0) = 0.25f * (image.at(2 * x, 2 * y, 0) + image.at(2 * x + 1, 2 * y, 0) +
                                 image.at(2 * x, 2 * y + 1, 0) + image.at(2 * x + 1, 2 * y + 1, 0));
    }
  }
  return out;
}

// Reads a picture between its pixels, all of them at the same shift.
class Shifted {
 public:
  Shifted(const Image& image, glm::dvec2 shift)
      : image_(image),
        x_(static_cast<int>(std::floor(shift.x))),
        y_(static_cast<int>(std::floor(shift.y))),
        right_(shift.x - x_),
        below_(shift.y - y_) {}

  // Whether at() and its neighbours have a place in the picture.
  bool holds(int x, int y) const {
    return x + x_ >= 1 && x + x_ + 2 < image_.width && y + y_ >= 1 && y + y_ + 2 < image_.height;
  }
  double at(int x, int y, int channel) const {
    const auto pixel = [&](int dx, int dy) {
      return static_cast<double>(image_.at(x + x_ + dx, y + y_ + dy, channel));
    };
    return (1 - below_) * ((1 - right_) * pixel(0, 0) + right_ * pixel(1, 0)) +
           below_ * ((1 - right_) * pixel(0, 1) + right_ * pixel(1, 1));
  }

 private:
  const Image& image_;
  int x_, y_;
  double right_, below_;
};

// Adds up add(y, sums) over the rows of a picture, which is the same however many cores do it.
template <std::size_t Size, class Add>
std::array<double, Size> sum_rows(int height, const Add& add) {
  const auto rows = static_cast<std::size_t>(height);
  std::vector<std::array<double, Size>> parts((rows + kRows - 1) / kRows);
  in_chunks(rows, kRows, [&](std::size_t begin, std::size_t end) {
    std::array<double, Size> sums{};
    for (std::size_t y = begin; y < end; ++y) add(static_cast<int>(y), sums);
    parts[begin / kRows] = sums;
  });
  std::array<double, Size> out{};
  for (const std::array<double, Size>& part : parts) {
    for (std::size_t k = 0; k < Size; ++k) out[k] += part[k];
  }
  return out;
}

// The step of Gauss and Newton from a shift.
glm::dvec2 step_from(const Pair& pair, glm::dvec2 shift) {
  const Shifted picture(pair.picture, shift);
  const auto [xx, xy, yy, x_error, y_error] =
      sum_rows<5>(pair.photo.height, [&](int y, std::array<double, 5>& sums) {
        for (int x = 0; x < pair.photo.width; ++x) {
          if (!picture.holds(x, y)) continue;
          const auto weight = static_cast<double>(pair.weight.at(x, y, 0));
          const double dx = 0.5 * (picture.at(x + 1, y, 0) - picture.at(x - 1, y, 0));
          const double dy = 0.5 * (picture.at(x, y + 1, 0) - picture.at(x, y - 1, 0));
          const double error = static_cast<double>(pair.photo.at(x, y, 0)) - picture.at(x, y, 0);
          sums[0] += weight * dx * dx;
          sums[1] += weight * dx * dy;
          sums[2] += weight * dy * dy;
          sums[3] += weight * dx * error;
          sums[4] += weight * dy * error;
        }
      });
  const double determinant = xx * yy - xy * xy;
  // Nothing to see, or lines of one direction alone.
  if (!(determinant > 1e-6 * (xx + yy) * (xx + yy))) return glm::dvec2(0.0);
  const glm::dvec2 step{(yy * x_error - xy * y_error) / determinant,
                        (xx * y_error - xy * x_error) / determinant};
  const double longest = std::max(std::abs(step.x), std::abs(step.y));
  return longest > kLongest ? step * (kLongest / longest) : step;
}

// The weighted squares of the errors without and with the shift, of the same pixels.
std::array<double, 2> errors(const Image& image,
                             const Image& photo,
                             const Image& weight,
                             glm::dvec2 shift) {
  const Shifted still(image, glm::dvec2(0.0)), moved(image, shift);
  return sum_rows<2>(photo.height, [&](int y, std::array<double, 2>& sums) {
    for (int x = 0; x < photo.width; ++x) {
      if (!still.holds(x, y) || !moved.holds(x, y)) continue;
      for (int c = 0; c < 3; ++c) {
        const auto wanted = static_cast<double>(photo.at(x, y, c));
        const double before = still.at(x, y, c) - wanted, after = moved.at(x, y, c) - wanted;
        sums[0] += static_cast<double>(weight.at(x, y, 0)) * before * before;
        sums[1] += static_cast<double>(weight.at(x, y, 0)) * after * after;
      }
    }
  });
}

}  // namespace

ShiftFit fit_shift(const Image& image, const Image& photo, const Image& weight) {
  std::vector<Pair> sizes{{brightness(image), brightness(photo), weight}};
  while (std::max(sizes.back().photo.width, sizes.back().photo.height) >= 2 * kCoarsest) {
    const Pair& last = sizes.back();
    sizes.push_back({halved(last.picture), halved(last.photo), halved(last.weight)});
  }
  glm::dvec2 shift{0.0};
  for (auto size = sizes.rbegin(); size != sizes.rend(); ++size) {
    if (size != sizes.rbegin()) shift *= 2.0;
    for (int k = 0; k < kSteps; ++k) {
      const glm::dvec2 step = step_from(*size, shift);
      shift += step;
      if (glm::length(step) < kSettled) break;
    }
  }
  // Farther is no error of a pose, but a picture of something else.
  if (glm::length(shift) > kFarthest * std::max(image.width, image.height)) return {};
  const auto [before, after] = errors(image, photo, weight, shift);
  if (!(after < before)) return {};
  return {shift, 10.0 * std::log10(before / std::max(after, 1e-10 * before))};
}

}  // namespace raysplats
