// SPDX-License-Identifier: Apache-2.0
#include "scene/kd_tree.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "util/parallel.hpp"

namespace raysplats {

template <class Number>
KdTree<Number>::KdTree(std::span<const Number> positions)
    : positions_(positions), order_(positions.size() / 3) {
  std::iota(order_.begin(), order_.end(), 0u);
  axis_.resize(order_.size());
  build(0, order_.size());
}

template <class Number>
Number KdTree<Number>::mean_distance(std::uint32_t index) const {
  Search<3> search(place_of(index), index);
  run(search, 0, order_.size());
  double sum = 0;
  std::size_t found = 0;
  for (const Number squared : search.nearest) {
    if (!std::isfinite(squared)) continue;
    sum += std::sqrt(static_cast<double>(squared));
    ++found;
  }
  return found > 0 ? static_cast<Number>(sum / static_cast<double>(found)) : Number{0};
}

template <class Number>
Number KdTree<Number>::nearest_distance(const Place& place, Number within) const {
  const Number most = within * within;
  Search<1> search(place, kNone);
  search.nearest[0] = most;
  run(search, 0, order_.size());
  const Number squared = search.nearest[0];
  return squared < most ? std::sqrt(squared) : std::numeric_limits<Number>::infinity();
}

template <class Number>
void KdTree<Number>::build(std::size_t begin, std::size_t end) {
  if (end - begin < 2) return;
  std::array<Number, 3> low{}, high{};
  low.fill(std::numeric_limits<Number>::infinity());
  high.fill(-std::numeric_limits<Number>::infinity());
  for (std::size_t i = begin; i < end; ++i) {
    for (std::size_t a = 0; a < 3; ++a) {
      low[a] = std::min(low[a], coordinate(order_[i], a));
      high[a] = std::max(high[a], coordinate(order_[i], a));
    }
  }
  std::size_t axis = 0;
  for (std::size_t a = 1; a < 3; ++a) {
    if (high[a] - low[a] > high[axis] - low[axis]) axis = a;
  }
  const std::size_t middle = begin + (end - begin) / 2;
  const auto at = [this](std::size_t i) { return order_.begin() + static_cast<std::ptrdiff_t>(i); };
  std::nth_element(at(begin), at(middle), at(end), [&](std::uint32_t a, std::uint32_t b) {
    return coordinate(a, axis) < coordinate(b, axis);
  });
  axis_[middle] = static_cast<std::uint8_t>(axis);
  build(begin, middle);
  build(middle + 1, end);
}

template <class Number>
template <std::size_t N>
void KdTree<Number>::run(Search<N>& search, std::size_t begin, std::size_t end) const {
  if (begin >= end) return;
  const std::size_t middle = begin + (end - begin) / 2;
  const std::uint32_t point = order_[middle];
  if (point != search.except) {
    Number squared = 0;
    for (std::size_t a = 0; a < 3; ++a) {
      const Number d = coordinate(point, a) - search.place[a];
      squared += d * d;
    }
    for (Number& kept : search.nearest) {
      if (squared < kept) std::swap(squared, kept);
    }
  }
  if (end - begin == 1) return;
  const std::size_t axis = axis_[middle];
  const Number offset = search.place[axis] - coordinate(point, axis);
  const bool below = offset < 0;
  const auto go_on = [&](bool lower) {
    if (lower) {
      run(search, begin, middle);
    } else {
      run(search, middle + 1, end);
    }
  };
  go_on(below);
  const Number outside = std::exchange(search.outside[axis], offset * offset);
  if (search.may_find()) go_on(!below);
  search.outside[axis] = outside;
}

template class KdTree<float>;
template class KdTree<double>;

std::vector<float> neighbour_distances(std::span<const float> positions) {
  const KdTree tree(positions);
  std::vector<float> out(positions.size() / 3);
  in_parallel(out.size(),
              [&](std::size_t i) { out[i] = tree.mean_distance(static_cast<std::uint32_t>(i)); });
  return out;
}

}  // namespace raysplats
