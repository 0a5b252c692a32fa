// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

namespace raysplats {

/// Balanced k-d tree of N points (3 N finite numbers, float or double, which it looks at as long as
/// it lives), laid out in place: the median of a range is its node, its halves are the children.
template <class Number>
class KdTree {
 public:
  using Place = std::array<Number, 3>;

  explicit KdTree(std::span<const Number> positions);

  /// Mean distance from point `index` to its three nearest neighbours (fewer when there are fewer
  /// points; 0 for a single one).
  Number mean_distance(std::uint32_t index) const;
  /// Distance from a place to the nearest point, the very number that comparing all of them gives;
  /// infinite when none is nearer than `within`.
  Number nearest_distance(const Place& place,
                          Number within = std::numeric_limits<Number>::infinity()) const;

 private:
  static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

  Number coordinate(std::uint32_t point, std::size_t axis) const {
    return positions_[3 * static_cast<std::size_t>(point) + axis];
  }
  Place place_of(std::uint32_t point) const {
    return {coordinate(point, 0), coordinate(point, 1), coordinate(point, 2)};
  }
  void build(std::size_t begin, std::size_t end);
  // What a search goes on with: from a place to all points but one.
  template <std::size_t N>
  struct Search {
    Place place;
    std::uint32_t except;
    std::array<Number, N> nearest;  // squared distances, ascending
    Place outside{};  // squares of how far the place is outside of the range, along each axis

    Search(const Place& from, std::uint32_t without) : place(from), except(without) {
      nearest.fill(std::numeric_limits<Number>::infinity());
    }
    // Whether a point of the range may be among the nearest. The sum is made as that of a squared
    // distance, so that rounding does not make it more than that of a point in the range. Points
    // equal to a median may lie on either side of it, hence "<=".
    bool may_find() const { return outside[0] + outside[1] + outside[2] <= nearest.back(); }
  };
  template <std::size_t N>
  void run(Search<N>& search, std::size_t begin, std::size_t end) const;

  std::span<const Number> positions_;
  std::vector<std::uint32_t> order_;
  std::vector<std::uint8_t> axis_;
};

extern template class KdTree<float>;
extern template class KdTree<double>;

/// KdTree::mean_distance() of each of N points (3 N numbers). O(N log N), on all cores but for the
/// tree.
std::vector<float> neighbour_distances(std::span<const float> positions);

}  // namespace raysplats
