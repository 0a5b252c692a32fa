// SPDX-License-Identifier: Apache-2.0
#include "train/loss/depth_cache.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <numeric>
#include <string>
#include <vector>

#include "raysplats/error.hpp"
#include "scene/image/pixel_count.hpp"
#include "unit/fixture.hpp"
#include "unit/io/scratch.hpp"
#include "unit/log_capture.hpp"
#include "unit/train/depth_file.hpp"
#include "util/rng.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

constexpr int kWidth = 37;
constexpr int kHeight = 23;
constexpr std::size_t kPixels = kWidth * kHeight;
constexpr std::size_t kBytes = sizeof(float) * kPixels;

struct Size {
  int width, height;
};
constexpr Size kSizes[] = {{18, 11}, {12, 8}, {9, 23}, {1, 1}, {36, 22}, {kWidth, kHeight}};

// Depths of so many of a picture's pixels, on average.
io::DepthMap random_map(std::uint64_t stream, double share) {
  io::DepthMap out{kWidth, kHeight, std::vector<float>(kPixels)};
  CounterRng rng(5, stream);
  for (float& value : out.values) {
    const double depth = 1.0 + rng.uniform();
    if (rng.uniform() < share) value = static_cast<float>(depth);
  }
  return out;
}

std::vector<std::size_t> all_of(const Dataset& data) {
  std::vector<std::size_t> out(data.views.size());
  std::iota(out.begin(), out.end(), std::size_t{0});
  return out;
}

// Views with a map each, called after their numbers.
Dataset with_maps(const Scratch& scratch, std::size_t count) {
  Dataset out;
  for (std::size_t i = 0; i < count; ++i) {
    View view;
    view.camera = view.source_camera =
        look_at({0, 0, 0}, {0, 0, 1}, {0, -1, 0}, kWidth, kHeight, kWidth);
    view.depth_path = scratch / (std::to_string(i) + ".npy");
    write_depth_file(view.depth_path, kWidth, kHeight, random_map(i, 0.7).values);
    out.views.push_back(view);
  }
  return out;
}

// Views of `width` x `height` pixels that show the same points.
Dataset with_points(std::size_t count, int width, int height, std::uint32_t points) {
  Dataset out;
  CounterRng rng(7, 0);
  for (std::uint32_t i = 0; i < points; ++i) {
    const double z = 2 + rng.uniform();
    for (const double value : {0.9 * (rng.uniform() - 0.5) * z, 0.5 * (rng.uniform() - 0.5) * z, z})
      out.points.positions.push_back(static_cast<float>(value));
    out.points.colors.insert(out.points.colors.end(), 3, 0.5f);
    out.points.track_lengths.push_back(9);
    out.points.errors.push_back(0.1f);
  }
  for (std::size_t i = 0; i < count; ++i) {
    View view;
    view.camera = view.source_camera =
        look_at({0, 0, 0}, {0, 0, 1}, {0, -1, 0}, width, height, width);
    view.points.resize(points);
    std::iota(view.points.begin(), view.points.end(), std::uint32_t{0});
    out.views.push_back(view);
  }
  return out;
}

std::vector<float> on_every_pixel(const DeviceDepths& depths) {
  if (!depths.listed) return depths.depths.download();
  std::vector<float> out(pixel_count(depths.width, depths.height));
  const std::vector<std::uint32_t> pixels = depths.pixels.download();
  const std::vector<float> values = depths.depths.download();
  for (std::size_t i = 0; i < depths.known; ++i) out.at(pixels[i]) = values[i];
  return out;
}

std::size_t known_in(const io::DepthMap& map) {
  return static_cast<std::size_t>(
      std::count_if(map.values.begin(), map.values.end(), [](float d) { return d > 0; }));
}

}  // namespace

TEST_CASE("lists of depths are reduced as maps are") {
  for (const double share : {0.02, 0.5, 1.0}) {
    const io::DepthMap map = random_map(1, share);
    std::vector<DepthPoint> points;
    for (std::size_t i = 0; i < kPixels; ++i) {
      if (map.values[i] > 0) points.push_back({static_cast<std::uint32_t>(i), map.values[i]});
    }
    for (const Size& size : kSizes) {
      CAPTURE(share);
      CAPTURE(size.width);
      const io::DepthMap expected = io::reduced(map, size.width, size.height);
      std::vector<float> got(expected.values.size());
      for (const DepthPoint& point : reduced(points, kWidth, kHeight, size.width, size.height)) {
        CHECK(got.at(point.pixel) == 0);
        got[point.pixel] = point.depth;
      }
      CHECK(got == expected.values);
    }
  }
}

TEST_CASE("sparse points of views take the room of their numbers, whatever the photos' size") {
  constexpr std::size_t kViews = 20;
  constexpr std::uint32_t kPoints = 50;
  const Dataset data = with_points(kViews, 640, 480, kPoints);
  Context context(test_device());
  DepthCache cache(context, data, all_of(data), 1.0, 0);
  CHECK(cache.with_points() == kViews);
  CHECK(cache.with_maps() == 0);
  const io::DepthMap known = io::view_depths(data, data.views[0], 1.0);
  for (const Size& size : {Size{160, 120}, Size{640, 480}}) {
    CAPTURE(size.width);
    const std::size_t before = context.allocated_bytes();
    const io::DepthMap expected = io::reduced(known, size.width, size.height);
    for (std::size_t i = 0; i < kViews; ++i) {
      const DeviceDepths& got = cache.get({i, size.width, size.height});
      REQUIRE(got.listed);
      CHECK(got.known == known_in(expected));
      CHECK(got.known > kPoints / 2);
      CHECK(on_every_pixel(got) == expected.values);
    }
    CHECK(context.allocated_bytes() <= before + kViews * kPoints * 8);
  }
  CHECK(cache.cached_bytes() == 0);
}

TEST_CASE("depth maps stay on the device within the budget, and the rest are read again") {
  const Scratch scratch;
  const Dataset data = with_maps(scratch, 4);
  std::vector<io::DepthMap> maps;
  for (const View& view : data.views) maps.push_back(io::view_depths({}, view, 1.0));
  Context context(test_device());
  DepthCache cache(context, data, all_of(data), 1.0, 2 * kBytes + 10);
  CHECK(cache.with_maps() == 4);
  CHECK(depth_map_bytes(data, all_of(data)) == 4 * kBytes);
  for (const Size& size : kSizes) {
    CAPTURE(size.width);
    for (int pass = 0; pass < 2; ++pass) {
      for (std::size_t i = 0; i < maps.size(); ++i) {
        // Of what is prefetched some is never asked for, and some is asked for twice.
        const std::vector<SizedView> next{{i, size.width, size.height},
                                          {(i + 2) % 4, size.width, size.height},
                                          {i, size.width, size.height}};
        cache.prefetch(next);
        const io::DepthMap expected = io::reduced(maps[i], size.width, size.height);
        for (int again = 0; again < 2; ++again) {
          const DeviceDepths& got = cache.get(next[0]);
          CHECK_FALSE(got.listed);
          CHECK(got.known == known_in(expected));
          CHECK(got.depths.download() == expected.values);
        }
        CHECK(cache.cached_bytes() <= 2 * kBytes + 10);
      }
    }
  }
  CHECK(cache.cached_bytes() == 2 * kBytes);
  cache.prefetch({});
  // Those that stay need their files no more; a map that is gone is named.
  std::vector<std::size_t> missing;
  for (const View& view : data.views) std::filesystem::remove(view.depth_path);
  for (std::size_t i = 0; i < maps.size(); ++i) {
    const SizedView view{i, kWidth, kHeight};
    const std::string error = data_error([&] { cache.get(view); });
    if (error.empty()) {
      CHECK(cache.get(view).depths.download() == maps[i].values);
    } else {
      CHECK(contains(error, std::to_string(i) + ".npy"));
      missing.push_back(i);
    }
  }
  CHECK(missing.size() >= 1);
  CHECK(missing.size() <= 2);  // the last one may still be there
}

TEST_CASE("a depth map that is prefetched for one size is right at another") {
  const Scratch scratch;
  const Dataset data = with_maps(scratch, 2);
  Context context(test_device());
  DepthCache cache(context, data, all_of(data), 1.0, 0);
  for (const Size& foreseen : kSizes) {
    for (const Size& size : kSizes) {
      CAPTURE(foreseen.width);
      CAPTURE(size.width);
      const std::vector<SizedView> next{{1, foreseen.width, foreseen.height}};
      cache.prefetch(next);
      const io::DepthMap expected =
          io::reduced(io::view_depths({}, data.views[1], 1.0), size.width, size.height);
      const DeviceDepths& got = cache.get({1, size.width, size.height});
      CHECK(got.known == known_in(expected));
      CHECK(got.depths.download() == expected.values);
      cache.get({0, size.width, size.height});  // in its place
    }
  }
}

TEST_CASE("views whose depth maps know nothing have no depths, and one warning counts them") {
  const Scratch scratch;
  const Dataset data = with_maps(scratch, 4);
  const std::vector<float> nothing(kPixels, 0.0f);
  for (const std::size_t i : {1u, 2u})
    write_depth_file(data.views[i].depth_path, kWidth, kHeight, nothing);
  Context context(test_device());
  {
    const LogCapture log;
    DepthCache cache(context, data, all_of(data), 1.0, 4 * kBytes);
    CHECK(log.lines() == 1);
    CHECK(log.contains("2 of 4 depth maps"));
    CHECK(log.contains("1.npy among them"));
    CHECK(cache.with_maps() == 2);
    CHECK(cache.with_points() == 0);
    const std::vector<SizedView> next{{1, 18, 11}, {3, 18, 11}};
    cache.prefetch(next);
    CHECK(cache.get(next[0]).known == 0);
    CHECK(cache.get(next[1]).known > 0);
    CHECK(log.lines() == 1);
  }
  for (const std::size_t i : {0u, 3u})
    write_depth_file(data.views[i].depth_path, kWidth, kHeight, nothing);
  const std::string error =
      data_error([&] { DepthCache(context, data, all_of(data), 1.0, 4 * kBytes); });
  CHECK(contains(error, "No depth map has a number above 0"));
}

TEST_CASE("what is wrong with depth maps is told when they are first read, and once") {
  const Scratch scratch;
  const Dataset data = with_maps(scratch, 2);
  std::vector<float> odd = random_map(0, 0.7).values;
  odd[3] = std::numeric_limits<float>::quiet_NaN();
  write_depth_file(data.views[0].depth_path, kWidth, kHeight, odd);
  Context context(test_device());
  const LogCapture log;
  DepthCache cache(context, data, all_of(data), 1.0, 0);
  for (int pass = 0; pass < 3; ++pass) {
    for (std::size_t i = 0; i < 2; ++i) cache.get({i, kWidth, kHeight});
  }
  CHECK(log.lines() == 1);
  CHECK(log.contains("0.npy are not finite"));
  std::filesystem::remove(data.views[1].depth_path);
  CHECK_THROWS_AS(DepthCache(context, data, all_of(data), 1.0, 0), DataError);
}
