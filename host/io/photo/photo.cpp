// SPDX-License-Identifier: Apache-2.0
#include "io/photo/photo.hpp"

#include <bit>

#include "io/photo/view_rows.hpp"
#include "scene/image/pixel_count.hpp"

namespace raysplats::io {
namespace {

constexpr float kByte = 255.0f;
constexpr float kShort = 65535.0f;

std::uint32_t rounded(float unit, float most) {
  // NOLINTNEXTLINE(bugprone-incorrect-roundings): never negative, and no call for every number
  return static_cast<std::uint32_t>(unit * most + 0.5f);
}

// Writes pixel `index` of the photo.
void store(Photo& photo, std::size_t index, const float* rgba) {
  std::uint32_t* word = photo.words.data() + index;
  const std::size_t plane = photo.pixels();
  if (photo.planes == 1) {
    *word = rounded(rgba[0], kByte) | rounded(rgba[1], kByte) << 8 | rounded(rgba[2], kByte) << 16 |
            rounded(rgba[3], kByte) << 24;
  } else if (photo.planes == 2) {
    word[0] = rounded(rgba[0], kShort) | rounded(rgba[1], kShort) << 16;
    word[plane] = rounded(rgba[2], kShort) | rounded(rgba[3], kShort) << 16;
  } else {
    for (std::size_t c = 0; c < 4; ++c) word[c * plane] = std::bit_cast<std::uint32_t>(rgba[c]);
  }
}

// Pixels of 8 bits a channel that nothing changes on their way.
void copy_bytes(const RawImage& image, const std::vector<std::uint8_t>& bytes, Photo& photo) {
  const auto channels = static_cast<std::size_t>(image.channels);
  const bool grey = channels < 3;
  const bool covered = channels == 2 || channels == 4;
  for (std::size_t i = 0; i < photo.pixels(); ++i) {
    const std::uint8_t* from = bytes.data() + i * channels;
    const std::uint32_t alpha = covered ? from[channels - 1] : 255u;
    photo.words[i] = std::uint32_t{from[0]} | std::uint32_t{from[grey ? 0 : 1]} << 8 |
                     std::uint32_t{from[grey ? 0 : 2]} << 16 | alpha << 24;
  }
}

}  // namespace

float Photo::weight(int x, int y) const {
  if (!weighted) return 1.0f;
  const std::uint32_t word = words[static_cast<std::size_t>(planes) * pixels() +
                                   static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                                   static_cast<std::size_t>(x)];
  return planes == 4 ? std::bit_cast<float>(word) : static_cast<float>(word) / kByte;
}

Sharpness sharpness(const Photo& photo) {
  return raysplats::sharpness(photo.width, photo.height, [&](int y, double* row) {
    for (int x = 0; x < photo.width; ++x) {
      const std::array<float, 4> rgba = photo.at(x, y);
      row[x] = static_cast<double>(rgba[3] * (rgba[0] + rgba[1] + rgba[2])) / 3.0;
    }
  });
}

std::size_t photo_bytes(const View& view) {
  const std::size_t pixels = pixel_count(view.camera);
  return sizeof(std::uint32_t) * pixels *
         static_cast<std::size_t>(view.sample_bytes + (view.mask_apart ? 1 : 0));
}

Photo load_photo(const View& view) {
  ViewRows rows(view);
  Photo photo{view.camera.width, view.camera.height, view.sample_bytes, view.mask_apart, {}};
  photo.words.resize(photo_bytes(view) / sizeof(std::uint32_t));
  const auto* bytes = std::get_if<std::vector<std::uint8_t>>(&rows.raw().numbers);
  if (bytes != nullptr && photo.planes == 1 && rows.unchanged()) {
    copy_bytes(rows.raw(), *bytes, photo);
    return photo;
  }
  const std::size_t plane = photo.pixels() * static_cast<std::size_t>(photo.planes);
  std::size_t index = 0;
  rows.read([&](const float* rgba, const float* weights) {
    for (int x = 0; x < photo.width; ++x, ++index) {
      store(photo, index, rgba + 4 * x);
      if (weights == nullptr) continue;
      photo.words[plane + index] =
          photo.planes == 4 ? std::bit_cast<std::uint32_t>(weights[x]) : rounded(weights[x], kByte);
    }
  });
  return photo;
}

}  // namespace raysplats::io
