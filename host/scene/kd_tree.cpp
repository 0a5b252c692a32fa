// SPDX-License-Identifier: Apache-2.0
#include "scene/kd_tree.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

namespace raysplats {

KdTree::KdTree(std::span<const float> positions)
    : positions_(positions), order_(positions.size() / 3) {
  std::iota(order_.begin(), order_.end(), 0u);
  axis_.resize(order_.size());
  build(0, order_.size());
}

float KdTree::mean_distance(std::uint32_t index) const {
  Nearest nearest{};
  nearest.fill(std::numeric_limits<float>::infinity());
  search(index, 0, order_.size(), nearest);
  double sum = 0;
  std::size_t found = 0;
  for (float squared : nearest) {
    if (!std::isfinite(squared)) continue;
    sum += std::sqrt(static_cast<double>(squared));
    ++found;
  }
  return found > 0 ? static_cast<float>(sum / static_cast<double>(found)) : 0.0f;
}

void KdTree::build(std::size_t begin, std::size_t end) {
  if (end - begin < 2) return;
  std::array<float, 3> low{}, high{};
  low.fill(std::numeric_limits<float>::infinity());
  high.fill(-std::numeric_limits<float>::infinity());
  for (std::size_t i = begin; i < end; ++i) {
    for (int a = 0; a < 3; ++a) {
      const auto axis = static_cast<std::size_t>(a);
      low[axis] = std::min(low[axis], coordinate(order_[i], a));
      high[axis] = std::max(high[axis], coordinate(order_[i], a));
    }
  }
  int axis = 0;
  for (int a = 1; a < 3; ++a) {
    const auto i = static_cast<std::size_t>(a), best = static_cast<std::size_t>(axis);
    if (high[i] - low[i] > high[best] - low[best]) axis = a;
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

void KdTree::search(std::uint32_t index,
                    std::size_t begin,
                    std::size_t end,
                    Nearest& nearest) const {
  if (begin >= end) return;
  const std::size_t middle = begin + (end - begin) / 2;
  const std::uint32_t point = order_[middle];
  if (point != index) {
    float squared = 0;
    for (int a = 0; a < 3; ++a) {
      const float d = coordinate(point, a) - coordinate(index, a);
      squared += d * d;
    }
    for (std::size_t k = 0; k < nearest.size(); ++k) {
      if (squared < nearest[k]) std::swap(squared, nearest[k]);
    }
  }
  if (end - begin == 1) return;
  const float offset = coordinate(index, axis_[middle]) - coordinate(point, axis_[middle]);
  // Points equal to the median may lie on either side, hence "<=" below for the far side.
  if (offset < 0) {
    search(index, begin, middle, nearest);
    if (offset * offset <= nearest.back()) search(index, middle + 1, end, nearest);
  } else {
    search(index, middle + 1, end, nearest);
    if (offset * offset <= nearest.back()) search(index, begin, middle, nearest);
  }
}

std::vector<float> neighbour_distances(std::span<const float> positions) {
  const KdTree tree(positions);
  std::vector<float> out(positions.size() / 3);
  for (std::size_t i = 0; i < out.size(); ++i)
    out[i] = tree.mean_distance(static_cast<std::uint32_t>(i));
  return out;
}

}  // namespace raysplats
