// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <glm/vec3.hpp>
#include <optional>

namespace raysplats::reference {

/// d mirrored at the plane with normal n (any side).
glm::dvec3 reflected(const glm::dvec3& d, const glm::dvec3& n);

/// Snell's law from index n1 to n2 for unit d and n with <d, n> <= 0; nothing beyond the critical
/// angle.
std::optional<glm::dvec3> refracted(const glm::dvec3& d, const glm::dvec3& n, double n1, double n2);

/// Unpolarised Fresnel reflectance: the mean of both polarisations' (Born and Wolf, 1.5.2); 1
/// beyond the critical angle. `cosine` is that of the incidence, in [0, 1].
double fresnel(double cosine, double n1, double n2);

}  // namespace raysplats::reference
