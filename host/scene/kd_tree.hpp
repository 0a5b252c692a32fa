// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace raysplats {

/// Balanced k-d tree of N points (3 N finite numbers, which it looks at as long as it lives), laid
/// out in place: the median of a range is its node, its halves are the children.
class KdTree {
 public:
  explicit KdTree(std::span<const float> positions);

  /// Mean distance from point `index` to its three nearest neighbours (fewer when there are fewer
  /// points; 0 for a single one).
  float mean_distance(std::uint32_t index) const;

 private:
  using Nearest = std::array<float, 3>;  // squared distances, ascending

  float coordinate(std::uint32_t point, int axis) const {
    return positions_[3 * static_cast<std::size_t>(point) + static_cast<std::size_t>(axis)];
  }
  void build(std::size_t begin, std::size_t end);
  void search(std::uint32_t index, std::size_t begin, std::size_t end, Nearest& nearest) const;

  std::span<const float> positions_;
  std::vector<std::uint32_t> order_;
  std::vector<std::uint8_t> axis_;
};

/// KdTree::mean_distance() of each of N points (3 N numbers). O(N log N).
std::vector<float> neighbour_distances(std::span<const float> positions);

}  // namespace raysplats
