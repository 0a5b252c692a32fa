// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

namespace raysplats {

/// Splits a polygon of n >= 3 corners into n - 2 triangles of corner numbers with its winding, by
/// cutting off ears (Meisters 1975) in the plane of its Newell normal (Sutherland et al. 1974). The
/// last four corners are split along the shorter of the possible diagonals. A polygon that is not
/// simple, or has no area, is split too, but not in a meaningful way. O(n^2), far less where few
/// corners are reflex: the number of looks at a corner is added to `work`.
std::vector<std::array<std::size_t, 3>> triangulate(std::span<const glm::dvec3> corners,
                                                    std::size_t* work = nullptr);

}  // namespace raysplats
