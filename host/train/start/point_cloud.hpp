// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>

#include "raysplats/dataset.hpp"

namespace raysplats {

/// Adds a point, its colour from 0 to 1.
void append_point(PointCloud& to, const glm::dvec3& position, const glm::dvec3& color);

/// Adds a point of `from`, without its track and error.
void append_point(const PointCloud& from, std::size_t i, PointCloud& to);

}  // namespace raysplats
