// SPDX-License-Identifier: Apache-2.0
#include "io/photo/photo_orientation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <variant>

#include "io/image/image_file.hpp"
#include "raysplats/error.hpp"

namespace raysplats::io {
namespace {

// Of EXIF: the turn that makes the picture upright.
constexpr int kClockwise = 6;
constexpr int kCounterclockwise = 8;

RawImage quarter_turned(const RawImage& raw, bool clockwise) {
  RawImage out{raw.height, raw.width, raw.channels, {}};
  const auto width = static_cast<std::size_t>(raw.width);
  const auto height = static_cast<std::size_t>(raw.height);
  const auto channels = static_cast<std::size_t>(raw.channels);
  std::visit(
      [&](const auto& from) {
        auto to = from;
        for (std::size_t y = 0; y < width; ++y) {
          for (std::size_t x = 0; x < height; ++x) {
            const std::size_t column = clockwise ? y : width - 1 - y;
            const std::size_t row = clockwise ? height - 1 - x : x;
            for (std::size_t c = 0; c < channels; ++c)
              to[(y * height + x) * channels + c] = from[(row * width + column) * channels + c];
          }
        }
        out.numbers = std::move(to);
      },
      raw.numbers);
  return out;
}

}  // namespace

bool lies_on_its_side(const std::filesystem::path& path) {
  const int orientation = image_orientation(path);
  return orientation == kClockwise || orientation == kCounterclockwise;
}

bool has_shape(int width, int height, const Camera& camera) {
  const double expected_height = static_cast<double>(camera.height) * width / camera.width;
  return std::abs(expected_height - height) <= std::max(2.0, 0.02 * height);
}

RawImage turned_upright(const RawImage& raw, const std::filesystem::path& path) {
  return quarter_turned(raw, image_orientation(path) == kClockwise);
}

RawImage as_stored(const RawImage& raw, const std::filesystem::path& path) {
  return quarter_turned(raw, image_orientation(path) != kClockwise);
}

StoredPhoto read_photo(const View& view) {
  const Camera& camera = view.source_camera;
  StoredPhoto out{read_raw_image(view.image_path)};
  // Sizes that differ by a turn alone are of set_cameras() (photo_views.cpp).
  const bool across = out.raw.width != out.raw.height && out.raw.width == camera.height &&
                      out.raw.height == camera.width;
  out.turned = across && lies_on_its_side(view.image_path);
  if (out.turned) out.raw = turned_upright(out.raw, view.image_path);
  if (out.raw.width != camera.width || out.raw.height != camera.height) {
    throw DataError(fmt::format(
        "The image {} has {} x {} pixels now, but {} x {} when the data set was opened",
        view.image_path.string(), out.raw.width, out.raw.height, camera.width, camera.height));
  }
  return out;
}

}  // namespace raysplats::io
