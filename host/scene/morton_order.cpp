// SPDX-License-Identifier: Apache-2.0
#include "scene/morton_order.hpp"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "scene/gaussians/gaussian_selection.hpp"

namespace raysplats {
namespace {

constexpr double kCells = 2097152.0;  // 2^21 along each axis

// Spreads the lowest 21 bits so that two zeros follow each.
std::uint64_t spread(std::uint64_t x) {
  x &= 0x1fffff;
  x = (x | x << 32) & 0x1f00000000ffffull;
  x = (x | x << 16) & 0x1f0000ff0000ffull;
  x = (x | x << 8) & 0x100f00f00f00f00full;
  x = (x | x << 4) & 0x10c30c30c30c30c3ull;
  x = (x | x << 2) & 0x1249249249249249ull;
  return x;
}

float quantile(std::vector<float>& values, double share) {
  if (values.empty()) return 0.0f;
  const auto middle =
      values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

std::vector<std::uint64_t> morton_codes(std::span<const float> positions) {
  const std::size_t count = positions.size() / 3;
  std::vector<std::uint64_t> codes(count, 0);
  std::vector<float> values;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    values.clear();
    for (std::size_t i = 0; i < count; ++i) {
      if (std::isfinite(positions[3 * i + axis])) values.push_back(positions[3 * i + axis]);
    }
    const double low = quantile(values, 0.01);
    const double high = quantile(values, 0.99);
    const double scale = high > low ? kCells / (high - low) : 0.0;
    for (std::size_t i = 0; i < count; ++i) {
      const double cell = (static_cast<double>(positions[3 * i + axis]) - low) * scale;
      // The comparison is false for NaN, which goes to cell 0.
      const double clamped = cell > 0 ? std::min(cell, kCells - 1) : 0.0;
      codes[i] |= spread(static_cast<std::uint64_t>(clamped)) << (2 - axis);
    }
  }
  return codes;
}

std::vector<std::uint32_t> morton_order(std::span<const float> positions) {
  const std::vector<std::uint64_t> codes = morton_codes(positions);
  std::vector<std::uint32_t> order(codes.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return codes[a] != codes[b] ? codes[a] < codes[b] : a < b;
  });
  return order;
}

Gaussians in_morton_order(const Gaussians& model) {
  return gathered(model, morton_order(model.means));
}

}  // namespace raysplats
