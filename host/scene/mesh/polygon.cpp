// SPDX-License-Identifier: Apache-2.0
#include "scene/mesh/polygon.hpp"

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <limits>
#include <optional>

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

/// What is left of a polygon while ears are cut off, as a ring of corners.
class Ears {
 public:
  explicit Ears(std::span<const glm::dvec3> corners)
      : points_(flattened(corners)),
        next_(corners.size()),
        previous_(corners.size()),
        kind_(corners.size(), Kind::kUnknown),
        size_(corners.size()),
        tests_left_(kTestsEach * corners.size()) {
    for (std::size_t i = 0; i < size_; ++i) {
      next_[i] = (i + 1) % size_;
      previous_[i] = (i + size_ - 1) % size_;
    }
    for (std::size_t i = 0; i < size_; ++i) {
      if (is_reflex(i)) reflex_.push_back(i);
    }
  }

  std::size_t size() const { return size_; }
  /// Corners that were looked at so far.
  std::size_t work() const { return work_; }
  std::size_t next(std::size_t corner) const { return next_[corner]; }

  /// A corner and its neighbours.
  std::array<std::size_t, 3> triangle(std::size_t corner) const {
    return {previous_[corner], corner, next_[corner]};
  }

  /// Whether the triangle at a corner is convex and holds no other corner that is left.
  bool is_ear(std::size_t corner) {
    const auto [a, b, c] = triangle(corner);
    if (turn(points_[a], points_[b], points_[c]) <= 0.0) return false;
    // Only a reflex corner can lie in it; repeated points (bridges to holes) do not count.
    for (const std::size_t i : reflex_) {
      ++work_;
      const glm::dvec2& p = points_[i];
      if (turn(points_[a], points_[b], p) >= 0.0 && turn(points_[b], points_[c], p) >= 0.0 &&
          turn(points_[c], points_[a], p) >= 0.0 && p != points_[a] && p != points_[b] &&
          p != points_[c]) {
        return false;
      }
    }
    return true;
  }

  /// The first ear from a corner on; the corner itself where there is none.
  std::size_t first_ear(std::size_t corner) {
    if (const auto ear = known_ear(corner)) return *ear;
    // Where corners touch others or lie on a line, cutting one may have freed one far away.
    if (tests_left_ < size_) return corner;
    for (std::size_t i = 0, at = corner; i < size_; ++i, at = next_[at]) {
      kind_[at] = Kind::kUnknown;
    }
    return known_ear(corner).value_or(corner);
  }

  void cut(std::size_t corner) {
    const std::array<std::size_t, 3> cut_off = triangle(corner);
    const std::array<std::size_t, 2> neighbors{cut_off[0], cut_off[2]};
    next_[neighbors[0]] = neighbors[1];
    previous_[neighbors[1]] = neighbors[0];
    --size_;
    std::erase_if(reflex_, [&](std::size_t i) {
      return std::find(cut_off.begin(), cut_off.end(), i) != cut_off.end();
    });
    // All others stay what they are: where corners lie in the triangle of one, the nearest to it is
    // reflex as long as it is there.
    for (const std::size_t i : neighbors) {
      if (is_reflex(i)) reflex_.push_back(i);
      kind_[i] = Kind::kUnknown;
    }
  }

 private:
  enum class Kind : char { kUnknown, kEar, kNoEar };
  /// A simple polygon needs three for each corner. One that crosses itself could ask for all of
  /// them again after every cut, and no split of it means much.
  static constexpr std::size_t kTestsEach = 6;

  bool is_reflex(std::size_t corner) const {
    const auto [a, b, c] = triangle(corner);
    return !(turn(points_[a], points_[b], points_[c]) > 0.0);
  }

  std::optional<std::size_t> known_ear(std::size_t corner) {
    for (std::size_t i = 0, at = corner; i < size_; ++i, at = next_[at]) {
      ++work_;
      if (kind_[at] == Kind::kUnknown) {
        kind_[at] = is_ear(at) ? Kind::kEar : Kind::kNoEar;
        tests_left_ -= tests_left_ > 0 ? 1 : 0;
      }
      if (kind_[at] == Kind::kEar) return at;
    }
    return std::nullopt;
  }

  std::vector<glm::dvec2> points_;
  std::vector<std::size_t> next_;
  std::vector<std::size_t> previous_;
  std::vector<Kind> kind_;
  std::vector<std::size_t> reflex_;  ///< corners that are left and not convex
  std::size_t size_;
  std::size_t tests_left_;
  std::size_t work_ = 0;
};

/// The ear of a quadrilateral whose cut is the shortest, the first of its corners without ears.
std::size_t best_of_four(Ears& ears, std::span<const glm::dvec3> corners, std::size_t one_of_them) {
  std::array<std::size_t, 4> left{one_of_them};
  for (std::size_t i = 1; i < 4; ++i) left[i] = ears.next(left[i - 1]);
  // In the order of the polygon, so that of equal cuts always the same is taken.
  std::sort(left.begin(), left.end());
  std::size_t best = left[0];
  double shortest = std::numeric_limits<double>::infinity();
  for (const std::size_t corner : left) {
    if (!ears.is_ear(corner)) continue;
    const auto [a, b, c] = ears.triangle(corner);
    const double length = glm::distance(corners[a], corners[c]);
    if (length < shortest) {
      best = corner;
      shortest = length;
    }
  }
  return best;
}

}  // namespace

std::vector<std::array<std::size_t, 3>> triangulate(std::span<const glm::dvec3> corners,
                                                    std::size_t* work) {
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
    at = ears.size() == 4 ? best_of_four(ears, corners, at) : ears.first_ear(at);
    triangles.push_back(ears.triangle(at));
    ears.cut(at);
    // The next corner's neighbour is gone: going on behind it keeps the triangles from being a fan.
    at = ears.next(ears.next(at));
  }
  if (work != nullptr) *work += ears.work();
  std::array<std::size_t, 3> last = ears.triangle(at);
  std::rotate(last.begin(), std::min_element(last.begin(), last.end()), last.end());
  triangles.push_back(last);
  return triangles;
}

}  // namespace raysplats
