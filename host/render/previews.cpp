// SPDX-License-Identifier: Apache-2.0
#include "render/previews.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/vec3.hpp>
#include <limits>

namespace raysplats {
namespace {

constexpr float kLeastNormal = 1e-5f;
constexpr float kLeastRange = 1e-5f;  // of depths; less is what rounding makes of a wall

Image channel(const Image& image, std::size_t number) {
  Image out(image.width, image.height, 1);
  const auto channels = static_cast<std::size_t>(image.channels);
  for (std::size_t i = 0; i < out.pixels(); ++i) out.data[i] = image.data[channels * i + number];
  return out;
}

/// Whether a pixel shows something, by the last channel.
bool is_covered(const Image& alpha, std::size_t pixel) {
  const auto channels = static_cast<std::size_t>(alpha.channels);
  return alpha.data[channels * pixel + channels - 1] >= 0.5f;
}

}  // namespace

Image box_average(const Image& image, int factor) {
  if (factor == 1) return image;
  Image out(image.width / factor, image.height / factor, image.channels);
  const float scale = 1.0f / static_cast<float>(factor * factor);
  for (int y = 0; y < out.height; ++y) {
    for (int x = 0; x < out.width; ++x) {
      for (int c = 0; c < out.channels; ++c) {
        float sum = 0.0f;
        for (int v = 0; v < factor; ++v) {
          for (int u = 0; u < factor; ++u) sum += image.at(x * factor + u, y * factor + v, c);
        }
        out.at(x, y, c) = sum * scale;
      }
    }
  }
  return out;
}

Image depth_preview(const Image& depth, const Image& alpha) {
  const auto covered = [&](std::size_t i) { return is_covered(alpha, i); };
  float low = std::numeric_limits<float>::infinity();
  float high = -low;
  for (std::size_t i = 0; i < depth.pixels(); ++i) {
    if (!covered(i)) continue;
    low = std::min(low, depth.data[i]);
    high = std::max(high, depth.data[i]);
  }
  Image out(depth.width, depth.height, 1);
  const bool flat = !(high - low > kLeastRange * std::abs(high));
  for (std::size_t i = 0; i < depth.pixels(); ++i) {
    if (covered(i)) out.data[i] = flat ? 1.0f : (high - depth.data[i]) / (high - low);
  }
  return out;
}

Image expected_of(const Image& depth) { return channel(depth, 0); }

Image hits_of(const Image& depth) { return channel(depth, 2); }

Image unit_normals(Image sums) {
  for (std::size_t i = 0; i < sums.pixels(); ++i) {
    float* n = &sums.data[3 * i];
    const float length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
    // Less is what rounding leaves of nothing.
    const float scale = length > kLeastNormal ? 1.0f / length : 0.0f;
    for (std::size_t c = 0; c < 3; ++c) n[c] *= scale;
  }
  return sums;
}

Image normals_preview(const Image& normals, const Image& alpha, const Camera& camera) {
  Image out(normals.width, normals.height, 3);
  for (std::size_t i = 0; i < normals.pixels(); ++i) {
    if (!is_covered(alpha, i)) continue;
    const float* n = &normals.data[3 * i];
    const glm::dvec3 seen = camera.rotation * glm::dvec3(n[0], n[1], n[2]);
    // The camera's y points down and its z away.
    const double axes[] = {seen.x, -seen.y, -seen.z};
    for (std::size_t c = 0; c < 3; ++c)
      out.data[3 * i + c] = static_cast<float>(0.5 + 0.5 * axes[c]);
  }
  return out;
}

Image hits_preview(const Image& hits) {
  Image out = hits;
  float most = 1.0f;
  for (const float count : hits.data) most = std::max(most, count);
  for (float& count : out.data) count /= most;
  return out;
}

}  // namespace raysplats
