// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace raysplats {

/// At most `levels` rising numbers, the nearest of which stands for each of `values` with least
/// squared error, nearly: the best cut of a histogram (dynamic programming with monotone cuts, Wu
/// 1991), then rounds of Lloyd 1982 on the values themselves. All of the values where there are no
/// more; none for none. Values are finite.
std::vector<float> best_levels(std::span<const float> values, std::size_t levels);

/// Index of the nearest of some rising numbers, of the lower one between two.
std::size_t nearest_level(std::span<const float> levels, float value);

/// Vectors that stand for others.
struct VectorPalette {
  std::vector<float> entries;         ///< of `width` numbers each
  std::vector<std::uint32_t> labels;  ///< which of them stands for a vector
};

/// At most `most` vectors for all of `vectors` (`width` numbers each, finite) with little squared
/// error: k-means (Lloyd 1982) in two stages, cells of space first, then entries within each in
/// proportion to how far its vectors lie from its middle. The vectors themselves, equal ones once,
/// where there are no more. The same for the same vectors, whatever the number of threads.
/// O(n sqrt(most) width).
VectorPalette vector_palette(std::span<const float> vectors, std::size_t width, std::size_t most);

}  // namespace raysplats
