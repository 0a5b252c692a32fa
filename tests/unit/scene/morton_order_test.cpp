// SPDX-License-Identifier: Apache-2.0
#include "scene/morton_order.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "util/rng.hpp"

using namespace raysplats;

namespace {

std::vector<float> normal_positions(std::size_t count) {
  CounterRng random(3, 0);
  std::vector<float> out(3 * count);
  for (float& x : out) x = static_cast<float>(random.normal());
  return out;
}

}  // namespace

TEST_CASE("Morton order is a permutation that an outlier does not spoil") {
  std::vector<float> positions = normal_positions(2000);
  positions[0] = 1e9f;
  positions[4] = std::numeric_limits<float>::quiet_NaN();
  std::vector<std::uint32_t> order = morton_order(positions);
  double along = 0;
  for (std::size_t i = 1; i < order.size(); ++i) {
    if (order[i] < 2 || order[i - 1] < 2) continue;
    double squared = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      squared += std::pow(positions[3 * order[i] + a] - positions[3 * order[i - 1] + a], 2);
    }
    along += std::sqrt(squared) / static_cast<double>(order.size());
  }
  // Two random points of a unit normal distribution are 2.3 apart on average.
  CHECK(along < 0.6);
  std::sort(order.begin(), order.end());
  for (std::size_t i = 0; i < order.size(); ++i) REQUIRE(order[i] == i);
  CHECK(morton_order({}).empty());
}

TEST_CASE("Morton order is that of the codes, and of the indices where those are equal") {
  // The last of these is sorted in parts, the last part a short one.
  for (const std::size_t count : {1u, 2u, 7u, 1000u, 200'000u}) {
    std::vector<float> positions = normal_positions(count);
    // Half of the points lie in places of others.
    for (std::size_t k = 0; k < 3 * (count / 2); ++k) {
      positions[k] = positions[positions.size() - 1 - k / 9 * 3 - k % 3];
    }
    const std::vector<std::uint64_t> codes = morton_codes(positions);
    const std::vector<std::uint32_t> order = morton_order(positions);
    REQUIRE(order.size() == count);
    for (std::size_t i = 1; i < count; ++i) {
      const std::uint32_t before = order[i - 1], now = order[i];
      REQUIRE((codes[before] < codes[now] || (codes[before] == codes[now] && before < now)));
    }
  }
}

TEST_CASE("a model in Morton order holds the same Gaussians") {
  Gaussians model;
  model.sh_degree = 1;
  model.resize(50);
  CounterRng random(4, 0);
  for (std::vector<float>* field :
       {&model.means, &model.quaternions, &model.log_scales, &model.opacities, &model.sh}) {
    for (float& x : *field) x = static_cast<float>(random.normal());
  }
  const Gaussians sorted = in_morton_order(model);
  CHECK(sorted.sh_degree == 1);
  const std::vector<std::uint32_t> order = morton_order(model.means);
  REQUIRE(sorted.size() == order.size());
  for (std::size_t i = 0; i < order.size(); ++i) {
    const std::size_t from = order[i];
    CHECK(sorted.means[3 * i + 2] == model.means[3 * from + 2]);
    CHECK(sorted.quaternions[4 * i + 3] == model.quaternions[4 * from + 3]);
    CHECK(sorted.log_scales[3 * i + 1] == model.log_scales[3 * from + 1]);
    CHECK(sorted.opacities[i] == model.opacities[from]);
    CHECK(sorted.sh[12 * i + 11] == model.sh[12 * from + 11]);
  }
  CHECK(in_morton_order({}).size() == 0);
}
