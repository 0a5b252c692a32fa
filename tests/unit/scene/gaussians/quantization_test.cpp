// SPDX-License-Identifier: Apache-2.0
#include "scene/gaussians/quantization.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "util/rng.hpp"

using namespace raysplats;

namespace {

double squared_error(const std::vector<float>& levels, const std::vector<float>& values) {
  double sum = 0;
  for (const float value : values) {
    double least = std::numeric_limits<double>::infinity();
    for (const float level : levels) {
      const double away = static_cast<double>(value) - static_cast<double>(level);
      least = std::min(least, away * away);
    }
    sum += least;
  }
  return sum;
}

/// The least squared error of all partitions of sorted values, by looking at each.
double best_error(const std::vector<float>& sorted, std::size_t from, std::size_t levels) {
  if (from == sorted.size()) return 0;
  if (levels == 0) return std::numeric_limits<double>::infinity();
  double best = std::numeric_limits<double>::infinity(), sum = 0, square = 0;
  for (std::size_t end = from + 1; end <= sorted.size(); ++end) {
    const auto value = static_cast<double>(sorted[end - 1]);
    sum += value;
    square += value * value;
    const double error = square - sum * sum / static_cast<double>(end - from);
    best = std::min(best, error + best_error(sorted, end, levels - 1));
  }
  return best;
}

}  // namespace

TEST_CASE("levels are the best there are, by looking at every partition") {
  for (const std::uint64_t seed : {1u, 2u, 3u, 4u, 5u}) {
    CounterRng random(seed, 0);
    std::vector<float> values(14);
    for (float& value : values) value = static_cast<float>(random.normal());
    for (const std::size_t levels : {1u, 2u, 3u, 5u}) {
      const std::vector<float> found = best_levels(values, levels);
      CHECK(found.size() <= levels);
      CHECK(std::is_sorted(found.begin(), found.end()));
      std::vector<float> sorted = values;
      std::sort(sorted.begin(), sorted.end());
      CHECK(squared_error(found, values) ==
            doctest::Approx(best_error(sorted, 0, levels)).epsilon(1e-5));
    }
  }
}

TEST_CASE("levels are the values where there are few, and bear values far away") {
  CHECK(best_levels({}, 4).empty());
  CHECK(best_levels(std::vector<float>{2, 1, 2, 1}, 2) == std::vector<float>{1, 2});
  std::vector<float> values;
  for (int i = 0; i < 20000; ++i) values.push_back(static_cast<float>(std::sin(i)));
  values.push_back(1e6f);
  const std::vector<float> levels = best_levels(values, 256);
  CHECK(levels.back() == 1e6f);
  values.pop_back();
  // 255 even levels would leave (2 / 255)^2 / 12 for each.
  CHECK(squared_error(levels, values) < 20000 * 1.2 * std::pow(2.0 / 255, 2) / 12);
}

TEST_CASE("the nearest of some levels") {
  const std::vector<float> levels{-1, 0, 4};
  const std::vector<std::pair<float, std::size_t>> known{{-9, 0},   {-0.6f, 0}, {-0.5f, 0}, {0, 1},
                                                         {1.9f, 1}, {2.1f, 2},  {9, 2}};
  for (const auto& [value, index] : known) CHECK(nearest_level(levels, value) == index);
}

TEST_CASE("a palette finds clusters, and is better than cells of even size") {
  // 40 clusters of small spread in five dimensions.
  constexpr std::size_t kWidth = 5, kClusters = 40, kEach = 60;
  CounterRng random(7, 0);
  std::vector<float> middles(kWidth * kClusters), vectors;
  for (float& x : middles) x = static_cast<float>(10 * random.normal());
  for (std::size_t i = 0; i < kClusters * kEach; ++i) {
    for (std::size_t d = 0; d < kWidth; ++d)
      vectors.push_back(middles[kWidth * (i % kClusters) + d] +
                        static_cast<float>(0.01 * random.normal()));
  }
  const VectorPalette palette = vector_palette(vectors, kWidth, 400);
  CHECK(palette.entries.size() <= 400 * kWidth);
  REQUIRE(palette.labels.size() == kClusters * kEach);
  double error = 0;
  for (std::size_t i = 0; i < palette.labels.size(); ++i) {
    for (std::size_t d = 0; d < kWidth; ++d) {
      const double away = vectors[kWidth * i + d] - palette.entries[kWidth * palette.labels[i] + d];
      error += away * away;
    }
  }
  CHECK(error / static_cast<double>(vectors.size()) < 1e-4);
  // The same again, and the vectors themselves where they all fit.
  CHECK(vector_palette(vectors, kWidth, 400).labels == palette.labels);
  const VectorPalette all = vector_palette(vectors, kWidth, kClusters * kEach);
  CHECK(all.entries == vectors);
  CHECK(all.labels[17] == 17);
}

TEST_CASE("a palette bears equal vectors") {
  const std::vector<float> vectors(3 * 1000, 0.5f);
  const VectorPalette palette = vector_palette(vectors, 3, 64);
  CHECK(palette.entries == std::vector<float>(3, 0.5f));
  for (const std::uint32_t label : palette.labels) CHECK(label == 0);
}

TEST_CASE("a palette has equal vectors once, and in no time where few differ") {
  // Entry by entry against every vector would be 2e10 products, several times.
  constexpr std::size_t kWidth = 45, kCount = 30000;
  std::vector<float> vectors(kWidth * kCount, 0.0f);
  for (std::size_t i = 0; i < kCount; i += 2) vectors[kWidth * i + 44] = 1.0f;
  vectors[kWidth * 7] = -1.0f;
  const VectorPalette palette = vector_palette(vectors, kWidth, 16384);
  REQUIRE(palette.entries.size() == 3 * kWidth);
  CHECK(palette.labels[0] == 0);
  CHECK(palette.labels[1] == 1);
  CHECK(palette.labels[7] == 2);
  CHECK(palette.labels[29998] == 0);
  CHECK(palette.entries[44] == 1.0f);
  CHECK(palette.entries[2 * kWidth] == -1.0f);
}
