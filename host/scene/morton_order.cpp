// SPDX-License-Identifier: Apache-2.0
#include "scene/morton_order.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#include "scene/gaussians/gaussian_selection.hpp"
#include "util/parallel.hpp"

namespace raysplats {
namespace {

constexpr double kCells = 2097152.0;     // 2^21 along each axis
constexpr std::size_t kChunk = 1 << 16;  // points that a core works on at a time

// A point's place along the curve.
struct Place {
  std::uint64_t code;
  std::uint32_t index;

  bool operator<(const Place& other) const {
    return code != other.code ? code < other.code : index < other.index;
  }
};

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

// Cells of the grid along one axis.
struct Cells {
  double low = 0, scale = 0;

  std::uint64_t of(float position) const {
    const double cell = (static_cast<double>(position) - low) * scale;
    // The comparison is false for NaN, which goes to cell 0.
    return static_cast<std::uint64_t>(cell > 0 ? std::min(cell, kCells - 1) : 0.0);
  }
};

Cells cells_along(std::span<const float> positions, std::size_t axis) {
  std::vector<float> values;
  values.reserve(positions.size() / 3);
  for (std::size_t i = axis; i < positions.size(); i += 3) {
    if (std::isfinite(positions[i])) values.push_back(positions[i]);
  }
  const double low = quantile(values, 0.01);
  const double high = quantile(values, 0.99);
  return {low, high > low ? kCells / (high - low) : 0.0};
}

// Chunks one beside the other, which are then merged in pairs.
void sort_places(std::vector<Place>& places) {
  const auto at = [&places](std::size_t i) {
    return places.begin() + static_cast<std::ptrdiff_t>(std::min(i, places.size()));
  };
  in_chunks(places.size(), kChunk,
            [&](std::size_t begin, std::size_t end) { std::sort(at(begin), at(end)); });
  for (std::size_t half = kChunk; half < places.size(); half *= 2) {
    in_chunks(places.size(), 2 * half, [&](std::size_t begin, std::size_t end) {
      std::inplace_merge(at(begin), at(begin + half), at(end));
    });
  }
}

}  // namespace

std::vector<std::uint64_t> morton_codes(std::span<const float> positions) {
  const std::size_t count = positions.size() / 3;
  std::array<Cells, 3> cells;
  in_parallel(3, [&](std::size_t axis) { cells[axis] = cells_along(positions, axis); });
  std::vector<std::uint64_t> codes(count);
  in_chunks(count, kChunk, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      const float* position = &positions[3 * i];
      codes[i] = spread(cells[0].of(position[0])) << 2 | spread(cells[1].of(position[1])) << 1 |
                 spread(cells[2].of(position[2]));
    }
  });
  return codes;
}

std::vector<std::uint32_t> morton_order(std::span<const float> positions) {
  const std::vector<std::uint64_t> codes = morton_codes(positions);
  std::vector<Place> places(codes.size());
  in_chunks(places.size(), kChunk, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) places[i] = {codes[i], static_cast<std::uint32_t>(i)};
  });
  sort_places(places);
  std::vector<std::uint32_t> order(places.size());
  std::ranges::transform(places, order.begin(), &Place::index);
  return order;
}

Gaussians in_morton_order(const Gaussians& model) {
  return gathered(model, morton_order(model.means));
}

}  // namespace raysplats
