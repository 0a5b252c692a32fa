// SPDX-License-Identifier: Apache-2.0
#include "io/resample.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>
#include <vector>

#include "core/camera_model.hpp"

namespace raysplats::io {
namespace {

constexpr std::size_t kChannels = 4;

/// Source pixels [first, first + weights.size()) of one target pixel along an axis; the weights sum
/// to 1.
struct Span {
  int first = 0;
  std::vector<float> weights;
};

std::vector<Span> area_spans(int source, int target) {
  std::vector<Span> spans(static_cast<std::size_t>(target));
  const double step = static_cast<double>(source) / target;
  for (int i = 0; i < target; ++i) {
    const double begin = i * step;
    const double end = std::min(begin + step, static_cast<double>(source));
    Span& span = spans[static_cast<std::size_t>(i)];
    span.first = std::min(static_cast<int>(begin), source - 1);
    // Ends that are whole up to rounding must not touch the next pixel.
    const int last = std::clamp(static_cast<int>(std::ceil(end - 1e-9)), span.first + 1, source);
    double sum = 0;
    for (int p = span.first; p < last; ++p)
      sum += std::min(end, p + 1.0) - std::max(begin, static_cast<double>(p));
    for (int p = span.first; p < last; ++p) {
      const double overlap = std::min(end, p + 1.0) - std::max(begin, static_cast<double>(p));
      span.weights.push_back(static_cast<float>(overlap / sum));
    }
  }
  return spans;
}

/// Writes a sum of alpha-weighted colours as straight colour and alpha.
void store_straight(const std::array<float, kChannels>& sum, float* out) {
  if (sum[3] > 0) {
    for (std::size_t c = 0; c < 3; ++c) out[c] = sum[c] / sum[3];
    out[3] = sum[3];
  }
}

/// Colours times alpha, in place.
void premultiply(Image& rgba) {
  for (std::size_t i = 0; i < rgba.data.size(); i += kChannels) {
    for (std::size_t c = 0; c < 3; ++c) rgba.data[i + c] *= rgba.data[i + 3];
  }
}

}  // namespace

Image area_resample(const Image& rgba, int width, int height) {
  if (width == rgba.width && height == rgba.height) return rgba;
  const std::vector<Span> columns = area_spans(rgba.width, width);
  const std::vector<Span> rows = area_spans(rgba.height, height);
  Image out(width, height, static_cast<int>(kChannels));
  const std::size_t row_floats = static_cast<std::size_t>(width) * kChannels;
  // Rows are averaged first, so that one row of sums is all the memory there is.
  std::vector<std::array<float, kChannels>> sums(static_cast<std::size_t>(rgba.width));
  for (int y = 0; y < height; ++y) {
    std::fill(sums.begin(), sums.end(), std::array<float, kChannels>{});
    const Span& span = rows[static_cast<std::size_t>(y)];
    for (std::size_t k = 0; k < span.weights.size(); ++k) {
      const float* source = &rgba.data[static_cast<std::size_t>(span.first + static_cast<int>(k)) *
                                       static_cast<std::size_t>(rgba.width) * kChannels];
      for (std::array<float, kChannels>& sum : sums) {
        const float weight = span.weights[k] * source[3];
        for (std::size_t c = 0; c < 3; ++c) sum[c] += weight * source[c];
        sum[3] += weight;
        source += kChannels;
      }
    }
    float* target = &out.data[static_cast<std::size_t>(y) * row_floats];
    for (const Span& column : columns) {
      std::array<float, kChannels> sum{};
      for (std::size_t k = 0; k < column.weights.size(); ++k) {
        const auto& source = sums[static_cast<std::size_t>(column.first) + k];
        for (std::size_t c = 0; c < kChannels; ++c) sum[c] += column.weights[k] * source[c];
      }
      store_straight(sum, target);
      target += kChannels;
    }
  }
  return out;
}

Image undistort(Image rgba, const Camera& camera) {
  const int width = rgba.width;
  const int height = rgba.height;
  premultiply(rgba);
  Image out(width, height, static_cast<int>(kChannels));
  const double limit = lens_limit(CameraModel::kOpenCv, camera.distortion);
  float* target = out.data.data();
  for (int j = 0; j < height; ++j) {
    for (int i = 0; i < width; ++i, target += kChannels) {
      const glm::dvec2 p((i + 0.5 - camera.cx) / camera.fx, (j + 0.5 - camera.cy) / camera.fy);
      if (p.x * p.x + p.y * p.y > limit * limit) continue;
      const glm::dvec2 seen = distort(camera.distortion, p);
      const double u = seen.x * camera.fx + camera.cx;
      const double v = seen.y * camera.fy + camera.cy;
      if (!(u >= 0 && u <= width && v >= 0 && v <= height)) continue;
      // Between the outermost pixel centres and the border the border pixel goes on.
      const double px = std::clamp(u - 0.5, 0.0, width - 1.0);
      const double py = std::clamp(v - 0.5, 0.0, height - 1.0);
      const int x0 = std::min(static_cast<int>(px), std::max(width - 2, 0));
      const int y0 = std::min(static_cast<int>(py), std::max(height - 2, 0));
      const auto wx = static_cast<float>(px - x0);
      const auto wy = static_cast<float>(py - y0);
      const std::size_t step_x = width > 1 ? kChannels : 0;
      const std::size_t step_y = height > 1 ? static_cast<std::size_t>(width) * kChannels : 0;
      const float* source =
          &rgba.data[(static_cast<std::size_t>(y0) * static_cast<std::size_t>(width) +
                      static_cast<std::size_t>(x0)) *
                     kChannels];
      const std::array<const float*, 4> taps{source, source + step_x, source + step_y,
                                             source + step_x + step_y};
      const std::array<float, 4> weights{(1 - wx) * (1 - wy), wx * (1 - wy), (1 - wx) * wy,
                                         wx * wy};
      std::array<float, kChannels> sum{};
      for (std::size_t tap = 0; tap < 4; ++tap) {
        for (std::size_t c = 0; c < kChannels; ++c) sum[c] += weights[tap] * taps[tap][c];
      }
      store_straight(sum, target);
    }
  }
  return out;
}

ViewPicture take_weight(Image rgba, const Image& weight) {
  ViewPicture out{std::move(rgba), Image(weight.width, weight.height, 1)};
  for (std::size_t i = 0; i < weight.pixels(); ++i) {
    const float share = weight.data[kChannels * i + 3];
    float& alpha = out.rgba.data[kChannels * i + 3];
    alpha = share > 0 ? std::min(alpha / share, 1.0f) : 0.0f;
    out.weight.data[i] = share;
  }
  return out;
}

void mask_unseen(Image& rgba, const Camera& camera) {
  if (camera.model != CameraModel::kOpenCv && camera.model != CameraModel::kFisheye) return;
  const double limit =
      radial_image(camera.model, camera.distortion, lens_limit(camera.model, camera.distortion));
  float* alpha = rgba.data.data() + 3;
  for (int j = 0; j < rgba.height; ++j) {
    for (int i = 0; i < rgba.width; ++i, alpha += kChannels) {
      const double x = (i + 0.5 - camera.cx) / camera.fx;
      const double y = (j + 0.5 - camera.cy) / camera.fy;
      if (x * x + y * y > limit * limit) *alpha = 0.0f;
    }
  }
}

}  // namespace raysplats::io
