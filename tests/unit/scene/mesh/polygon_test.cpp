// SPDX-License-Identifier: Apache-2.0
#include "scene/mesh/polygon.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <numbers>
#include <vector>

#include "util/rng.hpp"

using namespace raysplats;

namespace {

using Corners = std::vector<glm::dvec3>;

glm::dvec3 area(const Corners& corners, const std::array<std::size_t, 3>& t) {
  return 0.5 * glm::cross(corners[t[1]] - corners[t[0]], corners[t[2]] - corners[t[0]]);
}

/// Checks that the triangles tile a planar simple polygon: as many as needed, all of its
/// orientation, and their areas sum to its own, which they only do when none overlaps.
void check_tiling(const Corners& corners) {
  const auto triangles = triangulate(corners);
  REQUIRE(triangles.size() == corners.size() - 2);
  glm::dvec3 whole(0.0);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    whole +=
        0.5 * glm::cross(corners[i] - corners[0], corners[(i + 1) % corners.size()] - corners[0]);
  }
  double sum = 0.0;
  for (const auto& t : triangles) {
    const glm::dvec3 a = area(corners, t);
    CHECK(glm::dot(a, whole) >= -1e-9 * glm::dot(whole, whole));
    sum += glm::length(a);
  }
  CHECK(sum == doctest::Approx(glm::length(whole)).epsilon(1e-9));
}

Corners star(std::size_t points, double inner) {
  Corners corners;
  for (std::size_t i = 0; i < 2 * points; ++i) {
    const double angle = std::numbers::pi * static_cast<double>(i) / static_cast<double>(points);
    const double radius = i % 2 == 0 ? 1.0 : inner;
    corners.emplace_back(radius * std::cos(angle), radius * std::sin(angle), 0.0);
  }
  return corners;
}

}  // namespace

TEST_CASE("simple polygons of any shape, place and direction are tiled") {
  const Corners u_shape{{0, 0, 0}, {3, 0, 0}, {3, 3, 0}, {2, 3, 0},
                        {2, 1, 0}, {1, 1, 0}, {1, 3, 0}, {0, 3, 0}};
  const Corners dart{{0, 0, 0}, {2, -1, 0}, {0.5, 0, 0}, {2, 1, 0}};
  const Corners collinear{{0, 0, 0}, {1, 0, 0}, {2, 0, 0}, {2, 2, 0}, {1, 2, 0}, {0, 2, 0}};
  Corners spiral;
  for (int i = 0; i <= 60; ++i) {
    const double a = 0.15 * i;
    spiral.emplace_back((1.0 + a) * std::cos(a), (1.0 + a) * std::sin(a), 0.0);
  }
  for (int i = 60; i >= 0; --i) {
    const double a = 0.15 * i;
    spiral.emplace_back((1.5 + a) * std::cos(a), (1.5 + a) * std::sin(a), 0.0);
  }
  CounterRng rng(2, 9);
  for (const Corners& shape :
       {u_shape, dart, collinear, spiral, star(5, 0.4), star(50, 0.9), star(3, 1.0)}) {
    for (int round = 0; round < 8; ++round) {
      const glm::dquat turn =
          glm::normalize(glm::dquat(rng.normal(), rng.normal(), rng.normal(), rng.normal()));
      const glm::dvec3 offset(100.0 * rng.normal(), 100.0 * rng.normal(), 100.0 * rng.normal());
      Corners corners;
      for (const glm::dvec3& corner : shape) corners.push_back(turn * corner + offset);
      check_tiling(corners);
      std::reverse(corners.begin(), corners.end());
      check_tiling(corners);
      std::rotate(corners.begin(), corners.begin() + 1, corners.end());
      check_tiling(corners);
    }
  }
}

TEST_CASE("a spiral of many corners, in which ears are rare, is tiled") {
  // With a search through all corners for every triangle it would take half a minute.
  Corners spiral;
  constexpr int kHalf = 2048;
  const auto add = [&](int i, double from) {
    const double a = 200.0 * std::numbers::pi * i / kHalf;
    spiral.emplace_back((from + a) * std::cos(a), (from + a) * std::sin(a), 0.0);
  };
  for (int i = 0; i < kHalf; ++i) add(i, 1.0);
  for (int i = kHalf - 1; i >= 0; --i) add(i, 1.5);
  check_tiling(spiral);
}

TEST_CASE("a polygon with holes that bridges join is tiled, from whichever corner it begins") {
  Corners corners{{0, 0, 0}};
  for (const double x : {2.0, 5.0, 8.0}) {
    const Corners hole{{x, 0, 0},     {x, 1, 0},     {x - 1, 1, 0}, {x - 1, 3, 0},
                       {x + 1, 3, 0}, {x + 1, 1, 0}, {x, 1, 0},     {x, 0, 0}};
    corners.insert(corners.end(), hole.begin(), hole.end());
  }
  for (const glm::dvec3& corner : Corners{{10, 0, 0}, {10, 5, 0}, {0, 5, 0}}) {
    corners.push_back(corner);
  }
  for (std::size_t i = 0; i < corners.size(); ++i) {
    check_tiling(corners);
    std::rotate(corners.begin(), corners.begin() + 1, corners.end());
  }
}

TEST_CASE("a quadrilateral is split along its shorter diagonal") {
  const Corners kite{{0, -2, 0}, {1, 0, 0}, {0, 2, 0}, {-1, 0, 0}};
  for (const auto& t : triangulate(kite)) {
    CHECK(std::count(t.begin(), t.end(), std::size_t{1}) == 1);
    CHECK(std::count(t.begin(), t.end(), std::size_t{3}) == 1);
  }
}

TEST_CASE("what is no simple polygon still gives its number of triangles") {
  CHECK(triangulate(Corners{{0, 0, 0}, {1, 0, 0}}).empty());
  CHECK(triangulate(Corners(3, glm::dvec3(0.0))).size() == 1);
  CHECK(triangulate(Corners(7, glm::dvec3(1.0))).size() == 5);
  CHECK(triangulate(Corners{{0, 0, 0}, {1, 1, 0}, {1, 0, 0}, {0, 1, 0}}).size() == 2);
  const double nan = std::nan("");
  CHECK(triangulate(Corners{{0, 0, 0}, {1, nan, 0}, {1, 0, nan}, {0, 1, 0}, {2, 2, 2}}).size() ==
        3);
}
