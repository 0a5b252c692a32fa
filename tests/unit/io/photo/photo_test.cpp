// SPDX-License-Identifier: Apache-2.0
#include "io/photo/photo.hpp"

#include <OpenImageIO/imageio.h>
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "io/image/image_file.hpp"
#include "raysplats/io.hpp"
#include "scene/image/sharpness.hpp"
#include "unit/io/scratch.hpp"
#include "util/rng.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

constexpr int kWidth = 13;
constexpr int kHeight = 9;

/// Writes numbers of any type with OpenImageIO itself.
template <class T>
fs::path write_numbers(const fs::path& path, int channels, const std::vector<T>& numbers) {
  const OIIO::TypeDesc type = OIIO::BaseTypeFromC<T>::value;
  const auto output = OIIO::ImageOutput::create(path.string());
  REQUIRE(output);
  OIIO::ImageSpec spec(kWidth, kHeight, channels, type);
  spec.attribute("oiio:UnassociatedAlpha", 1);
  spec.attribute("compression", "zip");
  REQUIRE(output->open(path.string(), spec));
  REQUIRE(output->write_image(type, numbers.data()));
  REQUIRE(output->close());
  return path;
}

template <class T>
std::vector<T> random_numbers(int channels, double most) {
  CounterRng rng(3, static_cast<std::uint64_t>(channels));
  std::vector<T> out(static_cast<std::size_t>(kWidth * kHeight * channels));
  for (T& number : out) number = static_cast<T>(rng.uniform() * most);
  return out;
}

View view_of(const fs::path& path) {
  View view;
  view.image_path = path;
  view.camera.width = view.source_camera.width = kWidth;
  view.camera.height = view.source_camera.height = kHeight;
  view.sample_bytes = io::image_size(path).sample_bytes;
  return view;
}

/// Channel c of a pixel of the file as RGBA.
template <class T>
double channel(const std::vector<T>& numbers, int channels, std::size_t pixel, int c, double most) {
  const std::size_t first = pixel * static_cast<std::size_t>(channels);
  if (c == 3 && channels % 2 == 1) return 1.0;
  const int from = c == 3 ? channels - 1 : (channels < 3 ? 0 : c);
  return static_cast<double>(numbers[first + static_cast<std::size_t>(from)]) / most;
}

/// The largest difference of a photo to the numbers of its file.
template <class T>
double worst_difference(const io::Photo& photo,
                        const std::vector<T>& numbers,
                        int channels,
                        double most) {
  double worst = 0;
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const auto pixel = static_cast<std::size_t>(y * kWidth + x);
      for (int c = 0; c < 4; ++c) {
        const auto kept = static_cast<double>(photo.at(x, y)[static_cast<std::size_t>(c)]);
        worst = std::max(worst, std::abs(kept - channel(numbers, channels, pixel, c, most)));
      }
    }
  }
  return worst;
}

}  // namespace

TEST_CASE("photos of 8 bits are kept as in their files, grey or colour, with alpha or without") {
  const Scratch scratch;
  for (int channels = 1; channels <= 4; ++channels) {
    CAPTURE(channels);
    const auto numbers = random_numbers<std::uint8_t>(channels, 255.9);
    const View view = view_of(write_numbers(scratch / "a.png", channels, numbers));
    const io::Photo photo = io::load_photo(view);
    CHECK(view.sample_bytes == 1);
    CHECK(photo.planes == 1);
    CHECK(photo.bytes() == 4 * kWidth * kHeight);
    CHECK(photo.bytes() == io::photo_bytes(view));
    CHECK(worst_difference(photo, numbers, channels, 255) < 1e-7);
    Image over_black(kWidth, kHeight, 1);
    for (std::size_t i = 0; i < over_black.pixels(); ++i) {
      double sum = 0;
      for (int c = 0; c < 3; ++c) sum += channel(numbers, channels, i, c, 255);
      over_black.data[i] = static_cast<float>(sum / 3 * channel(numbers, channels, i, 3, 255));
    }
    CHECK(io::sharpness(photo).fine == doctest::Approx(sharpness(over_black).fine).epsilon(1e-5));
    CHECK(io::sharpness(photo).coarse ==
          doctest::Approx(sharpness(over_black).coarse).epsilon(1e-5));
    // The word of the device: r, g, b, a from the low byte.
    for (int c = 0; c < 4; ++c) {
      CHECK((photo.words[5] >> (8 * c) & 255u) ==
            std::lround(255 * channel(numbers, channels, 5, c, 255)));
    }
  }
}

TEST_CASE("photos of 16 bits and of floats keep their precision") {
  const Scratch scratch;
  for (const char* name : {"a.png", "a.tif"}) {
    for (const int channels : {1, 3, 4}) {
      const auto numbers = random_numbers<std::uint16_t>(channels, 65535.9);
      const View view = view_of(write_numbers(scratch / name, channels, numbers));
      const io::Photo photo = io::load_photo(view);
      CHECK(photo.planes == 2);
      CHECK(photo.bytes() == 8 * kWidth * kHeight);
      CHECK(worst_difference(photo, numbers, channels, 65535) < 1e-7);
    }
  }
  const auto numbers = random_numbers<float>(3, 1.0);
  Image display(kWidth, kHeight, 3);
  display.data = numbers;
  write_image(scratch / "a.exr", display, {}, ColorSpace::kDisplay);
  write_numbers(scratch / "b.tif", 3, numbers);
  for (const char* name : {"a.exr", "b.tif"}) {
    const View view = view_of(scratch / name);
    const io::Photo photo = io::load_photo(view);
    CHECK(photo.planes == 4);
    CHECK(photo.bytes() == 16 * kWidth * kHeight);
    CHECK(worst_difference(photo, numbers, 3, 1) == 0.0);
  }
}

TEST_CASE("numbers of float photos beyond [0, 1] count as its ends, NaN as 0") {
  const Scratch scratch;
  std::vector<float> numbers(3 * kWidth * kHeight, 0.5f);
  numbers[0] = 7.0f;
  numbers[1] = -2.0f;
  numbers[2] = std::numeric_limits<float>::quiet_NaN();
  numbers[3] = std::numeric_limits<float>::infinity();
  const View view = view_of(write_numbers(scratch / "a.tif", 3, numbers));
  const io::Photo photo = io::load_photo(view);
  CHECK(photo.at(0, 0) == std::array<float, 4>{1, 0, 0, 1});
  CHECK(photo.at(1, 0) == std::array<float, 4>{1, 0.5f, 0.5f, 1});
  CHECK(load_view_image(view).at(0, 0, 0) == 1.0f);
}

TEST_CASE("a photo is the picture of its view, rounded once to the precision of its file") {
  const Scratch scratch;
  std::vector<std::uint8_t> mask(kWidth * kHeight, 255);
  for (std::size_t i = 0; i < mask.size(); i += 3) mask[i] = i % 2 == 0 ? 0 : 90;
  write_numbers(scratch / "mask.png", 1, mask);
  const auto bytes = random_numbers<std::uint8_t>(4, 255.9);
  const auto shorts = random_numbers<std::uint16_t>(4, 65535.9);
  const auto floats = random_numbers<float>(4, 1.0);
  const fs::path paths[] = {write_numbers(scratch / "a.png", 4, bytes),
                            write_numbers(scratch / "b.png", 4, shorts),
                            write_numbers(scratch / "c.exr", 4, floats)};
  const double steps[] = {255, 65535, 1e7};
  for (int i = 0; i < 3; ++i) {
    for (const bool masked : {false, true}) {
      for (const bool apart : {false, true}) {
        for (const bool lens : {false, true}) {
          for (const bool smaller : {false, true}) {
            View view = view_of(paths[i]);
            if (masked) view.mask_path = scratch / "mask.png";
            view.mask_apart = apart;
            view.source_camera.fx = view.source_camera.fy = 12;
            view.source_camera.cx = 6;
            view.source_camera.cy = 5;
            if (lens) {
              view.source_camera.model = CameraModel::kOpenCv;
              view.source_camera.distortion.k1 = -0.1;
            }
            if (smaller) {
              view.camera.width = 5;
              view.camera.height = 4;
            }
            const ViewPicture picture = load_view_picture(view);
            const io::Photo photo = io::load_photo(view);
            CHECK(photo.weighted == apart);
            CHECK(photo.bytes() == io::photo_bytes(view));
            double worst = 0, worst_weight = 0;
            for (int y = 0; y < photo.height; ++y) {
              for (int x = 0; x < photo.width; ++x) {
                for (int c = 0; c < 4; ++c) {
                  const float kept = photo.at(x, y)[static_cast<std::size_t>(c)];
                  const float whole = picture.rgba.at(x, y, c);
                  worst = std::max(
                      worst, std::abs(static_cast<double>(kept) - static_cast<double>(whole)));
                }
                if (!apart) continue;
                const auto weight = static_cast<double>(photo.weight(x, y));
                worst_weight =
                    std::max(worst_weight,
                             std::abs(weight - static_cast<double>(picture.weight.at(x, y, 0))));
              }
            }
            CHECK(worst <= 0.5001 / steps[i]);
            CHECK(worst_weight <= 0.5001 / 255);
          }
        }
      }
    }
  }
}
