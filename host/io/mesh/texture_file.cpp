// SPDX-License-Identifier: Apache-2.0
#include "io/mesh/texture_file.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <cstddef>
#include <utility>
#include <variant>
#include <vector>

#include "io/image/image_codec.hpp"
#include "io/image/image_file.hpp"
#include "io/mesh/mesh_file.hpp"
#include "util/srgb.hpp"

namespace raysplats::io {
namespace {

constexpr float kMostLight = 1e6f;  // that scenes take

/// Brings numbers into [0, kMostLight]; of how many texels that changed any.
std::size_t bring_into_range(Image& texture) {
  std::size_t changed = 0;
  for (std::size_t texel = 0; texel < texture.pixels(); ++texel) {
    bool odd = false;
    for (std::size_t c = 0; c < 3; ++c) {
      float& number = texture.data[3 * texel + c];
      if (number >= 0.0f && number <= kMostLight) continue;
      number = number > 0.0f ? kMostLight : 0.0f;
      odd = true;
    }
    changed += odd ? 1 : 0;
  }
  return changed;
}

}  // namespace

Image read_texture(const std::filesystem::path& path) {
  RawImage raw = read_raw_image(path);
  const bool floats = std::holds_alternative<std::vector<float>>(raw.numbers);
  Image texture = to_texture(to_image(std::move(raw)));
  if (!floats) return texture;
  if (const std::size_t changed = bring_into_range(texture); changed > 0) {
    spdlog::warn(
        "{}: {} of {} texels have a number that is negative, not finite or above 1e6: the nearest "
        "from 0 to 1e6 takes its place, 0 that of one that is none",
        path.string(), changed, texture.pixels());
  }
  if (image_codec().photo_colors(path.string()).light) {
    std::transform(texture.data.begin(), texture.data.end(), texture.data.begin(),
                   [](float light) { return display_from_light(light); });
  }
  return texture;
}

}  // namespace raysplats::io
