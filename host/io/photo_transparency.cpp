// SPDX-License-Identifier: Apache-2.0
#include "io/photo_transparency.hpp"

#include <algorithm>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <string>
#include <type_traits>
#include <variant>
#include <vector>

#include "io/image_file.hpp"
#include "raysplats/error.hpp"
#include "scene/even_choice.hpp"
#include "util/path_text.hpp"

namespace raysplats::io {
namespace {

constexpr std::size_t kPhotos = 5;
constexpr std::size_t kSide = 64;  // of the grid of pixels that are looked at
constexpr std::size_t kPlaces = kSide * kSide;
constexpr double kOpaque = 0.9;
// Shares of the places: a photo with fewer is opaque, a border has no more, and is as much the
// same.
constexpr double kFew = 0.01;
constexpr double kWidestBorder = 1.0 / 3.0;
constexpr double kSame = 0.01;

using Places = std::bitset<kPlaces>;

double share(const Places& places) {
  return static_cast<double>(places.count()) / static_cast<double>(kPlaces);
}

// Where a grid over the photo is transparent.
Places transparent_places(const RawImage& photo) {
  Places out;
  const auto channels = static_cast<std::size_t>(photo.channels);
  if (channels != 2 && channels != 4) return out;
  const auto width = static_cast<std::size_t>(photo.width);
  const auto height = static_cast<std::size_t>(photo.height);
  std::visit(
      [&](const auto& numbers) {
        using Number = typename std::decay_t<decltype(numbers)>::value_type;
        double most = 1.0;
        if constexpr (std::is_same_v<Number, std::uint8_t>) most = 255.0;
        if constexpr (std::is_same_v<Number, std::uint16_t>) most = 65535.0;
        for (std::size_t place = 0; place < kPlaces; ++place) {
          const std::size_t x = (2 * (place % kSide) + 1) * width / (2 * kSide);
          const std::size_t y = (2 * (place / kSide) + 1) * height / (2 * kSide);
          const auto alpha = static_cast<double>(numbers[(y * width + x + 1) * channels - 1]);
          out[place] = alpha < kOpaque * most;
        }
      },
      photo.numbers);
  return out;
}

Places transparent_places(const View& view) {
  const std::string extension = lower_extension(view.image_path);
  for (const char* opaque : {".jpg", ".jpeg", ".jfif", ".hdr"}) {
    if (extension == opaque) return {};
  }
  try {
    return transparent_places(read_raw_image(view.image_path));
  } catch (const Error&) {
    return {};  // who needs the photo says what is wrong with it
  }
}

}  // namespace

Transparency transparency(std::span<const View> views) {
  const std::vector<std::size_t> chosen = even_choice(views.size(), kPhotos);
  std::vector<Places> photos;
  for (const std::size_t i : chosen) {
    const Places places = transparent_places(views[i]);
    if (share(places) >= kFew) photos.push_back(places);
  }
  if (2 * photos.size() <= chosen.size()) return Transparency::kNone;
  const bool border = std::all_of(photos.begin(), photos.end(), [&](const Places& places) {
    return share(places) <= kWidestBorder && share(places ^ photos.front()) <= kSame;
  });
  // One photo alone tells of no border that all have.
  return border && photos.size() > 1 ? Transparency::kBorder : Transparency::kCutOut;
}

}  // namespace raysplats::io
