// SPDX-License-Identifier: Apache-2.0
#include "train/loss/photo_cache.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "raysplats/io.hpp"
#include "scene/image/pixel_count.hpp"
#include "unit/fixture.hpp"
#include "unit/io/scratch.hpp"
#include "util/rng.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

constexpr int kWidth = 37;
constexpr int kHeight = 23;
constexpr std::size_t kBytes = std::size_t{4} * kWidth * kHeight;

/// Views of random photos: 8 bits as PNG, floats as EXR. Every fourth pixel is transparent.
std::vector<View> make_views(const Scratch& scratch, std::size_t count, const std::string& type) {
  std::vector<View> views(count);
  for (std::size_t i = 0; i < count; ++i) {
    CounterRng rng(11, i);
    Image image(kWidth, kHeight, 4);
    for (float& value : image.data) value = static_cast<float>(rng.uniform());
    for (std::size_t p = 0; p < image.pixels(); p += 4) image.data[4 * p + 3] = 0.0f;
    View& view = views[i];
    view.image_path = scratch / (std::to_string(i) + type);
    view.sample_bytes = type == ".exr" ? 4 : type == ".16.png" ? 2 : 1;
    write_image(view.image_path, image);
    view.camera.width = view.source_camera.width = kWidth;
    view.camera.height = view.source_camera.height = kHeight;
  }
  return views;
}

/// A photo at another size by overlap areas in double precision: RGBA and weight of a pixel.
std::array<double, 5> reduced_pixel(const io::Photo& photo, int width, int height, int x, int y) {
  std::array<double, 5> out{};
  for (int j = 0; j < photo.height; ++j) {
    for (int i = 0; i < photo.width; ++i) {
      const auto part = [](int target, int targets, int source, int sources) {
        const double scale = static_cast<double>(sources) / targets;
        return std::max(0.0, std::min((target + 1) * scale, source + 1.0) -
                                 std::max(target * scale, static_cast<double>(source))) /
               scale;
      };
      const double share = part(x, width, i, photo.width) * part(y, height, j, photo.height) *
                           static_cast<double>(photo.weight(i, j));
      const std::array<float, 4> rgba = photo.at(i, j);
      const double covered = share * static_cast<double>(rgba[3]);
      for (std::size_t c = 0; c < 3; ++c) out[c] += covered * static_cast<double>(rgba[c]);
      out[3] += covered;
      out[4] += share;
    }
  }
  for (std::size_t c = 0; c < 3; ++c) out[c] = out[3] > 0 ? out[c] / out[3] : 0.0;
  out[3] = out[4] > 0 ? out[3] / out[4] : 0.0;
  return out;
}

}  // namespace

TEST_CASE("a photo on the device is the file's, at its own size to the bit [small]") {
  const Scratch scratch;
  Context context(test_device());
  for (const char* type : {".png", ".exr"}) {
    const std::vector<View> views = make_views(scratch, 2, type);
    PhotoCache cache(context, views, 100 * kBytes, 2);
    for (const std::size_t i : {1u, 0u, 1u}) {
      const io::Photo expected = io::load_photo(views[i]);
      const DevicePhoto photo = cache.get(i, kWidth, kHeight);
      CHECK(photo.planes == expected.planes);
      CHECK(photo.words.download() == expected.words);
    }
  }
}

TEST_CASE("a reduced photo is the average over areas, of unrounded sums") {
  const Scratch scratch;
  Context context(test_device());
  Image mask(kWidth, kHeight, 1, 1.0f);
  for (std::size_t i = 0; i < mask.pixels(); i += 5) mask.data[i] = i % 2 == 0 ? 0.0f : 0.4f;
  write_image(scratch / "mask.png", mask);
  for (const char* type : {".png", ".exr"}) {
    for (const bool weighted : {false, true}) {
      std::vector<View> views = make_views(scratch, 1, type);
      if (weighted) {
        views[0].mask_path = scratch / "mask.png";
        views[0].mask_apart = true;
      }
      const io::Photo whole = io::load_photo(views[0]);
      PhotoCache cache(context, views, 100 * kBytes, 2);
      struct Size {
        int width, height;
      };
      for (const Size size : {Size{18, 11}, Size{12, 8}, Size{9, 23}, Size{1, 1}, Size{36, 22}}) {
        CAPTURE(size.width);
        const DevicePhoto photo = cache.get(0, size.width, size.height);
        REQUIRE(photo.planes == 4);
        REQUIRE(photo.weighted == weighted);
        const std::vector<std::uint32_t> words = photo.words.download();
        const std::size_t pixels = pixel_count(size.width, size.height);
        REQUIRE(words.size() == photo.words_of(pixels));
        double worst = 0;
        for (int y = 0; y < size.height; ++y) {
          for (int x = 0; x < size.width; ++x) {
            const auto at = static_cast<std::size_t>(y * size.width + x);
            const auto expected = reduced_pixel(whole, size.width, size.height, x, y);
            for (std::size_t c = 0; c < (weighted ? 5u : 4u); ++c) {
              const float number = std::bit_cast<float>(words[c * pixels + at]);
              worst = std::max(worst, std::abs(static_cast<double>(number) - expected[c]));
            }
          }
        }
        // Steps of 8 bits are 4e-3.
        CHECK(worst < 2e-6);
      }
    }
  }
}

TEST_CASE("what is left out of a photo counts for nothing, and all else as before [small]") {
  const Scratch scratch;
  Context context(test_device());
  Image mask(kWidth, kHeight, 1, 1.0f);
  for (std::size_t i = 0; i < mask.pixels(); i += 5) mask.data[i] = i % 2 == 0 ? 0.0f : 0.4f;
  write_image(scratch / "mask.png", mask);
  PixelMask moves(9, 5);
  for (const std::size_t i : {0u, 7u, 22u, 23u, 31u, 32u, 44u}) moves.set(i);
  for (const char* type : {".png", ".16.png", ".exr"}) {
    for (const bool cut_out : {false, true}) {
      for (const bool weighted : {false, true}) {
        if (weighted && !cut_out) continue;
        std::vector<View> views = make_views(scratch, 2, type);
        if (weighted) {
          views[0].mask_path = scratch / "mask.png";
          views[0].mask_apart = true;
        }
        PhotoCache cache(context, views, 100 * kBytes, 2);
        cache.leave_out(0, moves, cut_out);
        for (const auto& [width, height] : {std::pair{kWidth, kHeight}, std::pair{18, 11}}) {
          CAPTURE(width);
          const auto photo_of = [&](const DevicePhoto& photo) {
            return io::Photo{width, height, photo.planes, photo.weighted, photo.words.download()};
          };
          const io::Photo whole = photo_of(cache.get_whole(0, width, height));
          const io::Photo rest = photo_of(cache.get(0, width, height));
          REQUIRE(rest.weighted == (weighted || cut_out));
          CHECK(whole.weighted == weighted);
          for (int y = 0; y < height; ++y) {
            for (int x = 0; x < width; ++x) {
              const bool out = moves[static_cast<std::size_t>(y * 5 / height * 9 + x * 9 / width)];
              std::array<float, 4> expected = whole.at(x, y);
              if (out && !cut_out) expected[3] = 0.0f;
              CHECK(rest.at(x, y) == expected);
              if (!cut_out) continue;
              CHECK(rest.weight(x, y) == (out ? 0.0f : weighted ? whole.weight(x, y) : 1.0f));
            }
          }
          // Other photos, and this one once it is taken back, are as they were.
          CHECK(photo_of(cache.get(1, width, height)).words ==
                photo_of(cache.get_whole(1, width, height)).words);
        }
        cache.leave_out(0, {}, cut_out);
        CHECK(cache.get(0, kWidth, kHeight).words.download() == io::load_photo(views[0]).words);
      }
    }
  }
}

TEST_CASE("a photo stays on the device within the budget, and the rest are read again") {
  const Scratch scratch;
  Context context(test_device());
  const std::vector<View> views = make_views(scratch, 4, ".png");
  std::vector<std::vector<std::uint32_t>> expected;
  for (const View& view : views) expected.push_back(io::load_photo(view).words);
  PhotoCache cache(context, views, 2 * kBytes + 10, 1);
  cache.prefetch(std::vector<std::size_t>{0, 1, 2, 3});
  for (int pass = 0; pass < 2; ++pass) {
    for (std::size_t i = 0; i < views.size(); ++i) {
      CHECK(cache.get(i, kWidth, kHeight).words.download() == expected[i]);
      // One that stays serves another size too.
      CHECK(cache.get(i, 12, 8).planes == 4);
    }
    CHECK(cache.cached_bytes() == 2 * kBytes);
  }
  // Those that stay need their files no more; a photo that is gone is named.
  for (const View& view : views) std::filesystem::remove(view.image_path);
  CHECK(cache.get(0, kWidth, kHeight).words.download() == expected[0]);
  CHECK(cache.get(1, kWidth, kHeight).words.download() == expected[1]);
  CHECK(contains(data_error([&] { cache.get(2, kWidth, kHeight); }), "2.png"));
}
