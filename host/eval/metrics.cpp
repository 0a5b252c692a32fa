// SPDX-License-Identifier: Apache-2.0
#include "eval/metrics.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/mat4x4.hpp>
#include <glm/matrix.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <limits>
#include <vector>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

constexpr int kRadius = 5;
constexpr std::size_t kTaps = 2 * kRadius + 1;
constexpr double kC1 = 0.01 * 0.01;
constexpr double kC2 = 0.03 * 0.03;

void check_sizes(const Image& a, const Image& b, const char* metric) {
  if (a.width != b.width || a.height != b.height || a.channels != b.channels || a.data.empty()) {
    throw UsageError(
        fmt::format("{} compares images of equal size; these are {}x{}x{} and {}x{}x{}", metric,
                    a.width, a.height, a.channels, b.width, b.height, b.channels));
  }
}

std::array<double, kTaps> gaussian_window() {
  std::array<double, kTaps> window{};
  double sum = 0;
  for (std::size_t i = 0; i < kTaps; ++i) {
    const double x = static_cast<double>(i) - kRadius;
    sum += window[i] = std::exp(-x * x / (2 * 1.5 * 1.5));
  }
  for (double& weight : window) weight /= sum;
  return window;
}

// Index of a sample outside [0, n) with the edge sample repeated: b a | a b c | c b.
int reflect(int i, int n) {
  const int period = 2 * n;
  i = ((i % period) + period) % period;
  return i < n ? i : period - 1 - i;
}

// Window means of one plane, rows then columns, with `reflect` at the borders.
class Smoother {
 public:
  Smoother(int width, int height)
      : width_(width),
        height_(height),
        window_(gaussian_window()),
        line_(static_cast<std::size_t>(width + 2 * kRadius)),
        half_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height)) {}

  void operator()(const std::vector<double>& plane, std::vector<double>& out) {
    const auto width = static_cast<std::size_t>(width_);
    out.assign(plane.size(), 0.0);
    for (int y = 0; y < height_; ++y) {
      const double* row = plane.data() + static_cast<std::size_t>(y) * width;
      for (int x = -kRadius; x < width_ + kRadius; ++x)
        line_[static_cast<std::size_t>(std::ptrdiff_t{x} + kRadius)] = row[reflect(x, width_)];
      double* target = half_.data() + static_cast<std::size_t>(y) * width;
      for (std::size_t x = 0; x < width; ++x) {
        double sum = 0;
        for (std::size_t k = 0; k < kTaps; ++k) sum += window_[k] * line_[x + k];
        target[x] = sum;
      }
    }
    for (int y = 0; y < height_; ++y) {
      double* target = out.data() + static_cast<std::size_t>(y) * width;
      for (std::size_t k = 0; k < kTaps; ++k) {
        const int from = reflect(y + static_cast<int>(k) - kRadius, height_);
        const double* row = half_.data() + static_cast<std::size_t>(from) * width;
        for (std::size_t x = 0; x < width; ++x) target[x] += window_[k] * row[x];
      }
    }
  }

 private:
  int width_, height_;
  std::array<double, kTaps> window_;
  std::vector<double> line_, half_;
};

}  // namespace

double psnr(const Image& image, const Image& photo) {
  check_sizes(image, photo, "PSNR");
  double sum = 0;
  for (std::size_t i = 0; i < image.data.size(); ++i) {
    const double difference =
        static_cast<double>(image.data[i]) - static_cast<double>(photo.data[i]);
    sum += difference * difference;
  }
  if (sum == 0) return std::numeric_limits<double>::infinity();
  return -10.0 * std::log10(sum / static_cast<double>(image.data.size()));
}

double weighted_psnr(const Image& image, const Image& photo, const Image& weight) {
  check_sizes(image, photo, "PSNR");
  double sum = 0, weights = 0;
  for (std::size_t i = 0; i < image.data.size(); ++i) {
    const double difference =
        static_cast<double>(image.data[i]) - static_cast<double>(photo.data[i]);
    const auto w = static_cast<double>(weight.data[i / static_cast<std::size_t>(image.channels)]);
    sum += w * difference * difference;
    weights += w;
  }
  if (sum == 0) return std::numeric_limits<double>::infinity();
  return -10.0 * std::log10(sum / weights);
}

double corrected_psnr(const Image& image, const Image& photo, const Image& weight) {
  check_sizes(image, photo, "PSNR");
  const auto color = [](const Image& from, std::size_t i) {
    const float* p = from.data.data() + i * static_cast<std::size_t>(from.channels);
    return glm::dvec3(p[0], p[1], p[2]);
  };
  // Normal equations of the difference to the identity; the ridge keeps it small where an image of
  // few colours leaves it open.
  glm::dmat4 normal(0.0);
  std::array<glm::dvec4, 3> right{};
  double weights = 0;
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    const auto w = static_cast<double>(weight.data[i]);
    const glm::dvec4 x(color(image, i), 1.0);
    const glm::dvec3 miss = color(photo, i) - glm::dvec3(x);
    normal += w * glm::outerProduct(x, x);
    for (int c = 0; c < 3; ++c) right[static_cast<std::size_t>(c)] += w * miss[c] * x;
    weights += w;
  }
  if (weights == 0) throw UsageError("A PSNR was asked for of a photo that is masked out entirely");
  const glm::dmat4 inverse = glm::inverse(normal + glm::dmat4(1e-6 * weights));
  std::array<glm::dvec4, 3> change{};
  for (std::size_t c = 0; c < 3; ++c) change[c] = inverse * right[c];
  double sum = 0;
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    const glm::dvec4 x(color(image, i), 1.0);
    const glm::dvec3 y = color(photo, i);
    for (int c = 0; c < 3; ++c) {
      const double shown = x[c] + glm::dot(change[static_cast<std::size_t>(c)], x);
      const double miss = std::clamp(shown, 0.0, 1.0) - y[c];
      sum += static_cast<double>(weight.data[i]) * miss * miss;
    }
  }
  if (sum == 0) return std::numeric_limits<double>::infinity();
  return -10.0 * std::log10(sum / (3.0 * weights));
}

double ssim(const Image& image, const Image& photo) {
  check_sizes(image, photo, "SSIM");
  const std::size_t pixels = image.pixels();
  const bool small =
      image.width < static_cast<int>(kTaps) || image.height < static_cast<int>(kTaps);
  const int border = small ? 0 : kRadius;
  Smoother smooth(image.width, image.height);
  std::vector<double> a(pixels), b(pixels), square_sum(pixels), product(pixels);
  std::vector<double> mean_a, mean_b, mean_square, mean_product;
  double total = 0;
  for (int c = 0; c < image.channels; ++c) {
    for (std::size_t i = 0; i < pixels; ++i) {
      const std::size_t at =
          i * static_cast<std::size_t>(image.channels) + static_cast<std::size_t>(c);
      a[i] = static_cast<double>(image.data[at]);
      b[i] = static_cast<double>(photo.data[at]);
      square_sum[i] = a[i] * a[i] + b[i] * b[i];
      product[i] = a[i] * b[i];
    }
    smooth(a, mean_a);
    smooth(b, mean_b);
    smooth(square_sum, mean_square);
    smooth(product, mean_product);
    for (int y = border; y < image.height - border; ++y) {
      for (int x = border; x < image.width - border; ++x) {
        const std::size_t i = static_cast<std::size_t>(y) * static_cast<std::size_t>(image.width) +
                              static_cast<std::size_t>(x);
        const double means = mean_a[i] * mean_b[i];
        const double squares = mean_a[i] * mean_a[i] + mean_b[i] * mean_b[i];
        total += (2 * means + kC1) * (2 * (mean_product[i] - means) + kC2) /
                 ((squares + kC1) * (mean_square[i] - squares + kC2));
      }
    }
  }
  return total / (static_cast<double>(image.width - 2 * border) * (image.height - 2 * border) *
                  image.channels);
}

}  // namespace raysplats
