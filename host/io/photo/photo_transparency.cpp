// SPDX-License-Identifier: Apache-2.0
#include "io/photo/photo_transparency.hpp"

#include <algorithm>
#include <bitset>
#include <cstddef>
#include <cstdint>
#include <set>
#include <type_traits>
#include <variant>
#include <vector>

#include "io/image/image_file.hpp"
#include "io/image/image_header.hpp"
#include "raysplats/error.hpp"
#include "scene/even_choice.hpp"

namespace raysplats::io {
namespace {

constexpr std::size_t kPhotos = 5;
constexpr std::size_t kPhotosInDoubt = 20;  // a multiple, so that the five are among them
constexpr std::size_t kSide = 64;           // of the grid of pixels that are looked at
constexpr std::size_t kPlaces = kSide * kSide;
constexpr double kOpaque = 0.9;
// Shares of the places: a photo with fewer is opaque, a border has no more, and is as much the
// same.
constexpr double kFew = 0.01;
constexpr double kWidestBorder = 1.0 / 3.0;
constexpr double kSame = 0.01;
// Of the outermost places: around a body that was cut out more are transparent, but for close-ups.
constexpr double kLeastFrame = 0.1;

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
  try {
    return transparent_places(read_raw_image(view.image_path));
  } catch (const Error&) {
    return {};  // who needs the photo says what is wrong with it
  }
}

Places outermost_places() {
  Places out;
  for (std::size_t i = 0; i < kSide; ++i) {
    for (const std::size_t place : {i, kPlaces - 1 - i, i * kSide, (i + 1) * kSide - 1})
      out.set(place);
  }
  return out;
}

// Whether the photos are opaque along their edges, as the median has it: some photos of a body may
// be close-ups, and a hole may reach an edge.
bool have_holes(std::span<const Places> photos) {
  const Places frame = outermost_places();
  std::vector<std::size_t> counts;
  counts.reserve(photos.size());
  for (const Places& places : photos) counts.push_back((places & frame).count());
  const auto middle = counts.begin() + static_cast<std::ptrdiff_t>(counts.size() / 2);
  std::nth_element(counts.begin(), middle, counts.end());
  return static_cast<double>(*middle) < kLeastFrame * static_cast<double>(frame.count());
}

}  // namespace

TransparentPhotos transparency(std::span<const View> views) {
  // No picture is decoded of a file that says it is opaque.
  std::vector<std::size_t> candidates;
  for (std::size_t i = 0; i < views.size(); ++i) {
    if (may_be_transparent(views[i].image_path)) candidates.push_back(i);
  }
  std::set<std::size_t> looked_at;
  std::vector<Places> photos;
  for (const std::size_t most : {kPhotos, kPhotosInDoubt}) {
    for (const std::size_t i : even_choice(candidates.size(), most)) {
      if (!looked_at.insert(i).second) continue;
      const Places places = transparent_places(views[candidates[i]]);
      if (share(places) >= kFew) photos.push_back(places);
    }
    if (photos.empty() || photos.size() == looked_at.size()) break;
  }
  TransparentPhotos out;
  if (photos.empty()) return out;
  out.count = (photos.size() * candidates.size() + looked_at.size() / 2) / looked_at.size();
  out.exact = looked_at.size() == candidates.size();
  if (2 * out.count <= views.size()) return out;
  const bool border = std::all_of(photos.begin(), photos.end(), [&](const Places& places) {
    return share(places) <= kWidestBorder && share(places ^ photos.front()) <= kSame;
  });
  // One photo alone tells of no border that all have.
  if (border && photos.size() > 1) {
    out.kind = Transparency::kBorder;
  } else {
    out.kind = have_holes(photos) ? Transparency::kHoles : Transparency::kCutOut;
  }
  return out;
}

}  // namespace raysplats::io
