// SPDX-License-Identifier: Apache-2.0
#include "scene/kd_tree.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <vector>

#include "util/rng.hpp"

using namespace raysplats;

namespace {

std::vector<float> random_positions(std::size_t count, bool degenerate) {
  CounterRng rng(7, 1);
  std::vector<float> out;
  for (std::size_t i = 0; i < count; ++i) {
    // Degenerate: many equal coordinates and coincident points.
    for (int a = 0; a < 3; ++a) {
      out.push_back(degenerate ? static_cast<float>(rng.below(4))
                               : static_cast<float>(rng.normal()));
    }
  }
  return out;
}

std::vector<float> brute_force_distances(const std::vector<float>& p) {
  const std::size_t count = p.size() / 3;
  std::vector<float> out;
  for (std::size_t i = 0; i < count; ++i) {
    std::vector<double> distances;
    for (std::size_t j = 0; j < count; ++j) {
      if (i == j) continue;
      double squared = 0;
      for (std::size_t a = 0; a < 3; ++a)
        squared += std::pow(static_cast<double>(p[3 * i + a]) - p[3 * j + a], 2);
      distances.push_back(std::sqrt(squared));
    }
    std::sort(distances.begin(), distances.end());
    const std::size_t k = std::min<std::size_t>(3, distances.size());
    double sum = 0;
    for (std::size_t n = 0; n < k; ++n) sum += distances[n];
    out.push_back(k > 0 ? static_cast<float>(sum / static_cast<double>(k)) : 0.0f);
  }
  return out;
}

void check_brute_force(const std::vector<float>& positions) {
  const std::vector<float> expected = brute_force_distances(positions);
  const std::vector<float> found = neighbour_distances(positions);
  REQUIRE(found.size() == expected.size());
  for (std::size_t i = 0; i < found.size(); ++i)
    CHECK(found[i] == doctest::Approx(expected[i]).epsilon(1e-5));
}

}  // namespace

TEST_CASE("neighbour distances equal brute force") {
  for (const bool degenerate : {false, true}) {
    for (const std::size_t count : {0u, 1u, 2u, 3u, 4u, 5u, 300u})
      check_brute_force(random_positions(count, degenerate));
  }
}

TEST_CASE("the nearest point of a tree is as far away as comparing all tells, to the last bit") {
  for (const bool degenerate : {false, true}) {
    for (const std::size_t count : {0u, 1u, 2u, 3u, 100u, 1000u}) {
      const std::vector<float> random = random_positions(count, degenerate);
      // Numbers that no float holds.
      std::vector<double> positions(random.begin(), random.end());
      if (!degenerate) {
        for (double& value : positions) value /= 3;
      }
      const KdTree<double> tree(positions);
      CounterRng rng(9, count);
      for (int n = 0; n < 300; ++n) {
        // Far off, among the points, and where one may be.
        const double reach = n % 3 == 0 ? 100.0 : 1.0;
        glm::dvec3 place(reach * rng.normal(), reach * rng.normal(), reach * rng.normal());
        if (n % 3 == 2) place = glm::round(place);
        double least = std::numeric_limits<double>::infinity();
        for (std::size_t i = 0; i < positions.size(); i += 3) {
          const glm::dvec3 point(positions[i], positions[i + 1], positions[i + 2]);
          least = std::min(least, glm::distance(point, place));
        }
        CHECK(tree.nearest_distance({place.x, place.y, place.z}) == least);
        for (const double within : {0.3, 1.0, 2.0}) {
          CHECK(tree.nearest_distance({place.x, place.y, place.z}, within) ==
                (least < within ? least : std::numeric_limits<double>::infinity()));
        }
      }
    }
  }
}

TEST_CASE("neighbour distances of no point, of one, and of fewer than three neighbours") {
  CHECK(neighbour_distances({}).empty());
  CHECK(neighbour_distances(std::vector<float>{1, 2, 3}) == std::vector<float>{0});
  CHECK(neighbour_distances(std::vector<float>{0, 0, 0, 0, 3, 4}) == std::vector<float>{5, 5});
  CHECK(neighbour_distances(std::vector<float>{0, 0, 0, 2, 0, 0, 6, 0, 0}) ==
        std::vector<float>{4, 3, 5});
}

TEST_CASE("neighbour distances of points in one place, and of neighbours equally far away") {
  CHECK(neighbour_distances(std::vector<float>(3 * 50, 0.7f)) == std::vector<float>(50, 0));
  // Four in each of three places: three neighbours are where the point is.
  std::vector<float> places;
  for (int i = 0; i < 12; ++i) places.insert(places.end(), {0, static_cast<float>(i % 3), 0});
  CHECK(neighbour_distances(places) == std::vector<float>(12, 0));
  // Three in each: one of the neighbours is one away.
  places.resize(3 * std::size_t{9});
  CHECK(neighbour_distances(places) == std::vector<float>(9, static_cast<float>(1.0 / 3)));
  // Every point of a lattice has neighbours one away along each axis, as many as equal medians.
  std::vector<float> lattice;
  for (int i = 0; i < 216; ++i) {
    lattice.insert(lattice.end(), {static_cast<float>(i % 6), static_cast<float>(i / 6 % 6),
                                   static_cast<float>(i / 36)});
  }
  CHECK(neighbour_distances(lattice) == std::vector<float>(216, 1));
  check_brute_force(lattice);
  // On a line that no other axis divides.
  std::vector<float> line;
  for (int i = 0; i < 40; ++i) line.insert(line.end(), {1, -2, static_cast<float>(i * i % 23)});
  check_brute_force(line);
}
