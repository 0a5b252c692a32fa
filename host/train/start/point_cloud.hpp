// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <vector>

#include "raysplats/dataset.hpp"

namespace raysplats {

/// The i-th of a cloud's positions or colours.
inline glm::dvec3 triple(const std::vector<float>& values, std::size_t i) {
  return {values[3 * i], values[3 * i + 1], values[3 * i + 2]};
}

/// Adds a point, its colour from 0 to 1.
void append_point(PointCloud& to, const glm::dvec3& position, const glm::dvec3& color);

/// Adds a point of `from`, without its track and error.
void append_point(const PointCloud& from, std::size_t i, PointCloud& to);

}  // namespace raysplats
