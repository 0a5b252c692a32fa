// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "raysplats/gaussians.hpp"

namespace raysplats {

/// 63-bit Morton codes of N points (3 N numbers). The grid spans the 1 % to 99 % quantiles of each
/// axis, so that a few far points do not squeeze all others into one cell; points outside, and
/// non-finite ones, count to the border.
std::vector<std::uint64_t> morton_codes(std::span<const float> positions);

/// Indices of the points along the Morton curve; equal codes in order of the index.
std::vector<std::uint32_t> morton_order(std::span<const float> positions);

/// The model with its Gaussians along the Morton curve: neighbours in space are neighbours in
/// memory, which is what tracing large models is bound by.
Gaussians in_morton_order(const Gaussians& model);

}  // namespace raysplats
