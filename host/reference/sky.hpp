// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <glm/vec3.hpp>
#include <vector>

#include "reference/gaussian.hpp"

namespace raysplats::reference {

/// What lies behind everything along a direction of any length: options.sky where it is given, else
/// options.background.
glm::dvec3 light_behind(const TraceOptions& options, const glm::dvec3& direction);

/// dL/d(direction) from dL/d(light_behind).
glm::dvec3 light_behind_gradient(const TraceOptions& options,
                                 const glm::dvec3& direction,
                                 const glm::dvec3& color_gradient);

/// dL/d(options.sky), 3 numbers a coefficient, from dL/d(light_behind).
std::vector<double> sky_gradient(const TraceOptions& options,
                                 const glm::dvec3& direction,
                                 const glm::dvec3& color_gradient);

}  // namespace raysplats::reference
