// SPDX-License-Identifier: Apache-2.0
#include "view/sampling.hpp"

#include <algorithm>
#include <utility>

#include "render/previews.hpp"
#include "scene/image/pixel_places.hpp"

namespace raysplats::view {
namespace {

/// The radical inverse.
double halton(std::uint64_t index, std::uint64_t base) {
  double value = 0.0;
  double digit = 1.0;
  for (; index > 0; index /= base) {
    digit /= static_cast<double>(base);
    value += digit * static_cast<double>(index % base);
  }
  return value;
}

/// RGBA of one or three channels.
Image opaque(const Image& picture) {
  Image out(picture.width, picture.height, 4, 1.0f);
  const auto channels = static_cast<std::size_t>(picture.channels);
  for (std::size_t i = 0; i < picture.pixels(); ++i) {
    for (std::size_t c = 0; c < 3; ++c)
      out.data[4 * i + c] = picture.data[channels * i + std::min(c, channels - 1)];
  }
  return out;
}

}  // namespace

Camera jittered(Camera camera, std::uint64_t sample) {
  if (sample == 0) return camera;
  return moved_in_pixels(std::move(camera),
                         glm::dvec3(halton(sample, 2), halton(sample, 3), halton(sample, 5)) - 0.5);
}

Image alpha_picture(const Image& rgba) {
  Image out = rgba;
  for (std::size_t i = 0; i < rgba.pixels(); ++i) {
    float* pixel = &out.data[4 * i];
    pixel[0] = pixel[1] = pixel[2] = pixel[3];
  }
  return out;
}

Image depth_picture(const Image& depth, const Image& alpha) {
  return opaque(depth_preview(expected_of(depth), alpha));
}

Image normals_picture(const Image& sums, const Image& alpha, const Camera& camera) {
  return opaque(normals_preview(unit_normals(sums), alpha, camera));
}

Image hits_picture(const Image& depth) { return opaque(hits_preview(hits_of(depth))); }

}  // namespace raysplats::view
