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
#include <numeric>
#include <vector>

#include "raysplats/error.hpp"
#include "util/parallel.hpp"

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

// Window means of one channel of two images, of their squares' sum and of their product, row by
// row, with `reflect` at the borders.
class WindowMeans {
 public:
  static constexpr std::size_t kMoments = 4;
  using Row = std::array<std::vector<double>, kMoments>;

  // Rows are asked for from `first` on.
  WindowMeans(const Image& image, const Image& photo, int channel, int first)
      : image_(image),
        photo_(photo),
        channel_(channel),
        window_(gaussian_window()),
        next_(first - kRadius) {
    const auto width = static_cast<std::size_t>(image.width);
    for (std::vector<double>& line : padded_) line.resize(width + 2 * kRadius);
    for (Row& row : along_) {
      for (std::vector<double>& line : row) line.resize(width);
    }
    for (std::vector<double>& line : means_) line.resize(width);
  }

  // a, b, a^2 + b^2 and ab of row y; y does not fall from call to call.
  const Row& row(int y) {
    for (; next_ <= y + kRadius; ++next_) smooth_along(next_);
    for (std::size_t m = 0; m < kMoments; ++m) {
      std::ranges::fill(means_[m], 0.0);
      for (std::size_t k = 0; k < kTaps; ++k)
        add(window_[k], smoothed(y - kRadius + static_cast<int>(k))[m].data(), means_[m]);
    }
    return means_;
  }

 private:
  // Where the row y is, which may lie beyond the borders.
  Row& smoothed(int y) {
    return along_[static_cast<std::size_t>(std::ptrdiff_t{y} + kRadius) % kTaps];
  }

  static void add(double weight, const double* from, std::vector<double>& to) {
    for (std::size_t x = 0; x < to.size(); ++x) to[x] += weight * from[x];
  }

  void smooth_along(int y) {
    const int from = reflect(y, image_.height);
    for (int x = -kRadius; x < image_.width + kRadius; ++x) {
      const int column = reflect(x, image_.width);
      const auto a = static_cast<double>(image_.at(column, from, channel_));
      const auto b = static_cast<double>(photo_.at(column, from, channel_));
      const auto i = static_cast<std::size_t>(std::ptrdiff_t{x} + kRadius);
      padded_[0][i] = a;
      padded_[1][i] = b;
      padded_[2][i] = a * a + b * b;
      padded_[3][i] = a * b;
    }
    Row& out = smoothed(y);
    for (std::size_t m = 0; m < kMoments; ++m) {
      std::ranges::fill(out[m], 0.0);
      for (std::size_t k = 0; k < kTaps; ++k) add(window_[k], padded_[m].data() + k, out[m]);
    }
  }

  const Image& image_;
  const Image& photo_;
  int channel_;
  std::array<double, kTaps> window_;
  int next_;                      // first row that has not been smoothed along itself
  Row padded_;                    // a row with what lies beyond its ends
  std::array<Row, kTaps> along_;  // the last rows that have
  Row means_;
};

// Sum of the SSIM of a row's pixels that lie `border` from its ends, times their weights.
double ssim_of_row(const WindowMeans::Row& means, const float* weights, std::size_t border) {
  const auto& [mean_a, mean_b, mean_square, mean_product] = means;
  double sum = 0;
  for (std::size_t x = border; x + border < mean_a.size(); ++x) {
    const double product = mean_a[x] * mean_b[x];
    const double squares = mean_a[x] * mean_a[x] + mean_b[x] * mean_b[x];
    sum += static_cast<double>(weights[x]) * (2 * product + kC1) *
           (2 * (mean_product[x] - product) + kC2) /
           ((squares + kC1) * (mean_square[x] - squares + kC2));
  }
  return sum;
}

// Of the pixels that lie `border` from all borders.
double sum_of_weights(const Image& weight, int border) {
  double sum = 0;
  for (int y = border; y < weight.height - border; ++y) {
    for (int x = border; x < weight.width - border; ++x)
      sum += static_cast<double>(weight.at(x, y, 0));
  }
  return sum;
}

glm::dvec3 color_of(const Image& image, std::size_t pixel) {
  const float* p = image.data.data() + pixel * static_cast<std::size_t>(image.channels);
  return {p[0], p[1], p[2]};
}

// The affine map of colours that brings an image closest to a photo.
class ColorMap {
 public:
  ColorMap(const Image& image, const Image& photo, const Image& weight) {
    check_sizes(image, photo, "PSNR");
    // Normal equations of the difference to the identity; the ridge keeps it small where an image
    // of few colours leaves it open.
    glm::dmat4 normal(0.0);
    std::array<glm::dvec4, 3> right{};
    double weights = 0;
    for (std::size_t i = 0; i < image.pixels(); ++i) {
      const auto w = static_cast<double>(weight.data[i]);
      const glm::dvec4 x(color_of(image, i), 1.0);
      const glm::dvec3 miss = color_of(photo, i) - glm::dvec3(x);
      normal += w * glm::outerProduct(x, x);
      for (int c = 0; c < 3; ++c) right[static_cast<std::size_t>(c)] += w * miss[c] * x;
      weights += w;
    }
    if (weights == 0)
      throw UsageError("A PSNR was asked for of a photo that is masked out entirely");
    const glm::dmat4 inverse = glm::inverse(normal + glm::dmat4(1e-6 * weights));
    for (std::size_t c = 0; c < 3; ++c) change_[c] = inverse * right[c];
  }

  glm::dvec3 shown(const glm::dvec3& color) const {
    const glm::dvec4 x(color, 1.0);
    glm::dvec3 out;
    for (int c = 0; c < 3; ++c)
      out[c] = color[c] + glm::dot(change_[static_cast<std::size_t>(c)], x);
    return out;
  }

 private:
  std::array<glm::dvec4, 3> change_{};
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
  const ColorMap map(image, photo, weight);
  double sum = 0, weights = 0;
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    const glm::dvec3 shown = map.shown(color_of(image, i));
    const glm::dvec3 y = color_of(photo, i);
    const auto w = static_cast<double>(weight.data[i]);
    for (int c = 0; c < 3; ++c) {
      const double miss = std::clamp(shown[c], 0.0, 1.0) - y[c];
      sum += w * miss * miss;
    }
    weights += w;
  }
  if (sum == 0) return std::numeric_limits<double>::infinity();
  return -10.0 * std::log10(sum / (3.0 * weights));
}

Image color_corrected(const Image& image, const Image& photo, const Image& weight) {
  const ColorMap map(image, photo, weight);
  Image out(image.width, image.height, 3);
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    const glm::dvec3 shown = map.shown(color_of(image, i));
    for (int c = 0; c < 3; ++c)
      out.data[3 * i + static_cast<std::size_t>(c)] = static_cast<float>(shown[c]);
  }
  return out;
}

double weighted_ssim(const Image& image, const Image& photo, const Image& weight) {
  check_sizes(image, photo, "SSIM");
  int border = std::min(image.width, image.height) < static_cast<int>(kTaps) ? 0 : kRadius;
  double weights = sum_of_weights(weight, border);
  if (weights == 0) weights = sum_of_weights(weight, border = 0);
  if (weights == 0)
    throw UsageError("An SSIM was asked for of a photo that is masked out entirely");
  // In bands of rows, of which each reads a few beyond its own.
  constexpr int kBand = 64;
  const int rows = image.height - 2 * border;
  const auto bands = static_cast<std::size_t>((rows + kBand - 1) / kBand);
  std::vector<double> sums(static_cast<std::size_t>(rows) *
                           static_cast<std::size_t>(image.channels));
  in_parallel(bands * static_cast<std::size_t>(image.channels), [&](std::size_t i) {
    const int channel = static_cast<int>(i / bands);
    const int begin = static_cast<int>(i % bands) * kBand;
    WindowMeans means(image, photo, channel, border + begin);
    for (int row = begin; row < std::min(begin + kBand, rows); ++row) {
      const int y = border + row;
      const float* of_row =
          weight.data.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(weight.width);
      sums[static_cast<std::size_t>(channel) * static_cast<std::size_t>(rows) +
           static_cast<std::size_t>(row)] =
          ssim_of_row(means.row(y), of_row, static_cast<std::size_t>(border));
    }
  });
  // In one order, whatever the number of threads.
  const double total = std::accumulate(sums.begin(), sums.end(), 0.0);
  return total / (weights * image.channels);
}

double ssim(const Image& image, const Image& photo) {
  return weighted_ssim(image, photo, Image(image.width, image.height, 1, 1.0f));
}

}  // namespace raysplats
