// SPDX-License-Identifier: Apache-2.0
#include "scene/polygon.hpp"

#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <limits>
#include <numeric>

namespace raysplats {
namespace {

/// The corners in the plane of the polygon, counter-clockwise.
std::vector<glm::dvec2> flattened(std::span<const glm::dvec3> corners) {
  glm::dvec3 normal(0.0);
  for (std::size_t i = 0; i < corners.size(); ++i) {
    // Relative to the first corner, so that a polygon far from the origin keeps its digits.
    normal += glm::cross(corners[i] - corners[0], corners[(i + 1) % corners.size()] - corners[0]);
  }
  // Dropping the largest axis keeps the order of the corners; a negative one mirrors them.
  const glm::dvec3 size = glm::abs(normal);
  const int dropped = size.x >= size.y && size.x >= size.z ? 0 : (size.y >= size.z ? 1 : 2);
  const int first = (dropped + 1) % 3;
  const int second = (dropped + 2) % 3;
  std::vector<glm::dvec2> points;
  points.reserve(corners.size());
  for (const glm::dvec3& corner : corners) {
    const glm::dvec3 p = corner - corners[0];
    points.push_back(normal[dropped] < 0.0 ? glm::dvec2(p[second], p[first])
                                           : glm::dvec2(p[first], p[second]));
  }
  return points;
}

double turn(const glm::dvec2& a, const glm::dvec2& b, const glm::dvec2& c) {
  return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
}

/// What is left of a polygon while ears are cut off.
class Ears {
 public:
  explicit Ears(std::span<const glm::dvec3> corners)
      : points_(flattened(corners)), left_(corners.size()) {
    std::iota(left_.begin(), left_.end(), std::size_t{0});
  }

  std::size_t size() const { return left_.size(); }

  std::array<std::size_t, 3> triangle(std::size_t at) const {
    const std::size_t n = left_.size();
    return {left_[(at + n - 1) % n], left_[at % n], left_[(at + 1) % n]};
  }

  /// Whether the triangle at a corner is convex and holds no other corner that is left.
  bool is_ear(std::size_t at) const {
    const auto [a, b, c] = triangle(at);
    if (turn(points_[a], points_[b], points_[c]) <= 0.0) return false;
    for (std::size_t i = 0; i < left_.size(); ++i) {
      const auto [before, p, after] = triangle(i);
      // Only a reflex corner can lie in it; repeated points (bridges to holes) do not count.
      if (turn(points_[before], points_[p], points_[after]) > 0.0) continue;
      if (points_[p] == points_[a] || points_[p] == points_[b] || points_[p] == points_[c]) {
        continue;
      }
      if (turn(points_[a], points_[b], points_[p]) >= 0.0 &&
          turn(points_[b], points_[c], points_[p]) >= 0.0 &&
          turn(points_[c], points_[a], points_[p]) >= 0.0) {
        return false;
      }
    }
    return true;
  }

  void cut(std::size_t at) { left_.erase(left_.begin() + static_cast<std::ptrdiff_t>(at)); }

 private:
  std::vector<glm::dvec2> points_;
  std::vector<std::size_t> left_;
};

/// The ear of a quadrilateral whose cut is the shortest, 0 without ears.
std::size_t best_of_four(const Ears& ears, std::span<const glm::dvec3> corners) {
  std::size_t best = 0;
  double shortest = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < 4; ++i) {
    if (!ears.is_ear(i)) continue;
    const auto [a, b, c] = ears.triangle(i);
    const double length = glm::distance(corners[a], corners[c]);
    if (length < shortest) {
      best = i;
      shortest = length;
    }
  }
  return best;
}

}  // namespace

std::vector<std::array<std::size_t, 3>> triangulate(std::span<const glm::dvec3> corners) {
  std::vector<std::array<std::size_t, 3>> triangles;
  if (corners.size() < 3) return triangles;
  triangles.reserve(corners.size() - 2);
  if (corners.size() == 3) {
    triangles.push_back({0, 1, 2});
    return triangles;
  }
  Ears ears(corners);
  std::size_t at = 1;
  while (ears.size() > 3) {
    const std::size_t n = ears.size();
    if (n == 4) {
      at = best_of_four(ears, corners);
    } else {
      std::size_t tried = 0;
      while (tried < n && !ears.is_ear((at + tried) % n)) ++tried;
      at = (at + tried) % n;
    }
    triangles.push_back(ears.triangle(at));
    ears.cut(at);
    // The next corner's neighbour is gone: going on behind it keeps the triangles from being a fan.
    at = (at + 1) % ears.size();
  }
  triangles.push_back(ears.triangle(1));
  return triangles;
}

}  // namespace raysplats
