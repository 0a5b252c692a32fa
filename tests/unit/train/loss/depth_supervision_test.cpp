// SPDX-License-Identifier: Apache-2.0
#include "train/loss/depth_supervision.hpp"

#include <doctest/doctest.h>

#include <cstdint>
#include <vector>

#include "raysplats/device.hpp"
#include "unit/fixture.hpp"
#include "unit/train/depth_file.hpp"
#include "util/rng.hpp"

using namespace raysplats;

namespace {

constexpr int kWidth = 7, kHeight = 5;
constexpr std::size_t kPixels = kWidth * kHeight;
constexpr double kWeight = 0.3;

// A view that shows some sparse points.
Dataset capture(CounterRng& rng) {
  Dataset out;
  View view;
  view.camera = view.source_camera =
      look_at({0, 0, 0}, {0, 0, 1}, {0, -1, 0}, kWidth, kHeight, kWidth);
  for (std::uint32_t i = 0; i < 12; ++i) {
    const double z = 2 + rng.uniform();
    for (const double value : {(rng.uniform() - 0.5) * z, 0.7 * (rng.uniform() - 0.5) * z, z})
      out.points.positions.push_back(static_cast<float>(value));
    out.points.colors.insert(out.points.colors.end(), 3, 0.5f);
    out.points.track_lengths.push_back(9);
    out.points.errors.push_back(0.1f);
    view.points.push_back(i);
  }
  out.views.push_back(view);
  return out;
}

std::vector<float> noise(CounterRng& rng, std::size_t count, double low, double high) {
  std::vector<float> out(count);
  for (float& value : out) value = static_cast<float>(low + (high - low) * rng.uniform());
  return out;
}

}  // namespace

TEST_CASE("known depths pull pixels as far as their photo counts there [small] [tiny]") {
  Context context{test_device()};
  CounterRng rng(7, 0);
  const TemporaryDirectory folder;
  Dataset sparse = capture(rng);
  const io::DepthMap known = io::view_depths(sparse, sparse.views[0], 1.0);
  double count = 0;
  for (const float d : known.values) count += d > 0 ? 1 : 0;
  REQUIRE(count > 6);
  // Another view of which everything is known.
  sparse.views.push_back(sparse.views[0]);
  sparse.views[1].depth_path = folder.path() / "whole.npy";
  write_depth_file(sparse.views[1].depth_path, kWidth, kHeight, std::vector<float>(kPixels, 2.5f));
  Dataset dense = sparse;  // the same as a map
  dense.views[0].depth_path = folder.path() / "depth.npy";
  write_depth_file(dense.views[0].depth_path, kWidth, kHeight, known.values);
  const std::vector<float> image = noise(rng, 4 * kPixels, 0.0, 1.0);
  const std::vector<float> depth = noise(rng, 3 * kPixels, 2.0, 3.0);
  const std::vector<float> before = noise(rng, 4 * kPixels, -1.0, 1.0);
  // Alpha and, for some, a plane of weights; nothing counts in every third pixel.
  std::vector<std::uint32_t> words(2 * kPixels);
  for (std::size_t i = 0; i < kPixels; ++i) {
    words[i] = i % 3 == 0 ? 0x00ffffffu : static_cast<std::uint32_t>(rng.below(256)) << 24;
    words[kPixels + i] = i % 3 == 1 ? 0u : static_cast<std::uint32_t>(rng.below(256));
  }
  Buffer<float> on_image(context, image.size(), "image"), on_depth(context, depth.size(), "depth");
  Buffer<float> gradient(context, before.size(), "gradient");
  Buffer<std::uint32_t> photo(context, words.size(), "photo");
  on_image.upload(image);
  on_depth.upload(depth);
  photo.upload(words);
  const std::vector<std::size_t> views{0, 1};
  for (const int kind : {0, 1, 2, 3}) {
    const bool weighted = kind % 2 == 1, mapped = kind >= 2;
    CAPTURE(weighted);
    CAPTURE(mapped);
    DepthSupervision supervision(context, mapped ? dense : sparse, views, kWeight, 1.0, kPixels);
    CHECK(supervision.maps() == (mapped ? 2 : 1));
    gradient.upload(before);
    // Its slopes are not to stay.
    supervision.backward({1, kWidth, kHeight}, on_image, on_depth, {photo, 1, weighted}, gradient);
    gradient.upload(before);
    supervision.backward({0, kWidth, kHeight}, on_image, on_depth, {photo, 1, weighted}, gradient);
    const std::vector<float> slopes = supervision.gradient().download();
    const std::vector<float> after = gradient.download();
    std::size_t pulled = 0;
    for (std::size_t i = 0; i < kPixels; ++i) {
      CAPTURE(i);
      const double d = static_cast<double>(known.values[i]);
      const double coverage = static_cast<double>(image[3 * kPixels + i]);
      const double expected = static_cast<double>(depth[i]);
      double slope = 0;
      if (d > 0 && coverage > 0.1) {
        const double counts =
            (words[i] >> 24) / 255.0 * (weighted ? words[kPixels + i] / 255.0 : 1);
        slope = counts * kWeight / count / (d * coverage) * (expected > d ? 1 : -1);
      }
      pulled += slope != 0 ? 1 : 0;
      CHECK(static_cast<double>(slopes[i]) == doctest::Approx(slope).epsilon(1e-5));
      for (std::size_t c = 0; c < 4; ++c) {
        const double was = static_cast<double>(before[c * kPixels + i]);
        CHECK(static_cast<double>(after[c * kPixels + i]) ==
              doctest::Approx(c == 3 ? was - slope * expected : was).epsilon(1e-5));
      }
    }
    CHECK(pulled > 2);
  }
}
