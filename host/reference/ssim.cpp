// SPDX-License-Identifier: Apache-2.0
#include "reference/ssim.hpp"

#include <array>
#include <cmath>
#include <cstddef>
#include <limits>

#include "raysplats/error.hpp"
#include "scene/image/pixel_count.hpp"

namespace raysplats::reference {
namespace {

constexpr int kRadius = 5;
constexpr double kSigma = 1.5;
constexpr double kC1 = 0.01 * 0.01;
constexpr double kC2 = 0.03 * 0.03;

using Window = std::array<std::array<double, 2 * kRadius + 1>, 2 * kRadius + 1>;

template <typename Weights>
auto& weight_at(Weights& window, int x, int y) {
  const auto column = static_cast<std::size_t>(x) + kRadius;
  const auto row = static_cast<std::size_t>(y) + kRadius;
  return window[row][column];
}

Window make_window() {
  Window out;
  double sum = 0.0;
  for (int y = -kRadius; y <= kRadius; ++y) {
    for (int x = -kRadius; x <= kRadius; ++x) {
      const double w = std::exp(-(x * x + y * y) / (2.0 * kSigma * kSigma));
      weight_at(out, x, y) = w;
      sum += w;
    }
  }
  for (auto& row : out) {
    for (double& w : row) w /= sum;
  }
  return out;
}

/// Calls visit(pixel, weight) for every pixel of the window about (x, y) that lies inside the
/// image.
template <typename Visit>
void for_window(const Window& window, int x, int y, int width, int height, const Visit& visit) {
  for (int v = -kRadius; v <= kRadius; ++v) {
    for (int u = -kRadius; u <= kRadius; ++u) {
      if (x + u < 0 || x + u >= width || y + v < 0 || y + v >= height) continue;
      const auto pixel = static_cast<std::size_t>(y + v) * static_cast<std::size_t>(width) +
                         static_cast<std::size_t>(x + u);
      visit(pixel, weight_at(window, u, v));
    }
  }
}

/// Windowed moments at one pixel.
struct Moments {
  double i = 0, t = 0, ii = 0, tt = 0, it = 0;
};

Moments moments(const Window& window,
                std::span<const double> image,
                std::span<const double> target,
                int x,
                int y,
                int width,
                int height) {
  Moments m;
  for_window(window, x, y, width, height, [&](std::size_t p, double w) {
    m.i += w * image[p];
    m.t += w * target[p];
    m.ii += w * image[p] * image[p];
    m.tt += w * target[p] * target[p];
    m.it += w * image[p] * target[p];
  });
  return m;
}

void check_sizes(std::span<const double> image,
                 std::span<const double> target,
                 int width,
                 int height) {
  if (width <= 0 || height <= 0 || image.size() != target.size() ||
      image.size() != pixel_count(width, height)) {
    throw UsageError(
        "the images compared by SSIM differ in size, pass two of width x height numbers");
  }
}

}  // namespace

Ssim ssim(std::span<const double> image, std::span<const double> target, int width, int height) {
  check_sizes(image, target, width, height);
  const Window window = make_window();
  Ssim out;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Moments m = moments(window, image, target, x, y, width, height);
      const double luminance = (2.0 * m.i * m.t + kC1) / (m.i * m.i + m.t * m.t + kC1);
      const double structure =
          (2.0 * (m.it - m.i * m.t) + kC2) / (m.ii - m.i * m.i + m.tt - m.t * m.t + kC2);
      out.map.push_back(luminance * structure);
      out.mean += out.map.back();
    }
  }
  out.mean /= static_cast<double>(out.map.size());
  return out;
}

std::vector<double> ssim_gradient(std::span<const double> image,
                                  std::span<const double> target,
                                  int width,
                                  int height) {
  check_sizes(image, target, width, height);
  const Window window = make_window();
  std::vector<double> out(image.size(), 0.0);
  const double scale = 1.0 / static_cast<double>(image.size());
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const Moments m = moments(window, image, target, x, y, width, height);
      const double a = 2.0 * m.i * m.t + kC1, b = m.i * m.i + m.t * m.t + kC1;
      const double c = 2.0 * (m.it - m.i * m.t) + kC2,
                   d = m.ii - m.i * m.i + m.tt - m.t * m.t + kC2;
      // By the three windowed moments that hold the image; then each pixel of the window gets its
      // share.
      const double by_i =
          (2.0 * m.t * (c - a) / (b * d)) - 2.0 * m.i * a * c * (1.0 / b - 1.0 / d) / (b * d);
      const double by_ii = -a * c / (b * d * d);
      const double by_it = 2.0 * a / (b * d);
      for_window(window, x, y, width, height, [&](std::size_t p, double w) {
        out[p] += scale * w * (by_i + 2.0 * by_ii * image[p] + by_it * target[p]);
      });
    }
  }
  return out;
}

double psnr(std::span<const double> image, std::span<const double> target) {
  if (image.empty() || image.size() != target.size()) {
    throw UsageError(
        "the images compared by PSNR differ in size, pass two of the same number of pixels");
  }
  double sum = 0.0;
  for (std::size_t i = 0; i < image.size(); ++i)
    sum += (image[i] - target[i]) * (image[i] - target[i]);
  if (sum == 0.0) return std::numeric_limits<double>::infinity();
  return -10.0 * std::log10(sum / static_cast<double>(image.size()));
}

}  // namespace raysplats::reference
