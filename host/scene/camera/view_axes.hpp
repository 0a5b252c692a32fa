// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <span>

#include "raysplats/camera.hpp"

namespace raysplats {

/// The unit vector along which a camera looks, in the world.
glm::dvec3 view_axis(const Camera& camera);

/// Equations of the point x that is nearest to view axes in the mean square: normal x = right. The
/// squared distance of x from an axis through c along d is |P (x - c)|^2 with P = I - d d^T.
struct AxesFit {
  glm::dmat3 normal{0.0};  ///< sum P; singular where the axes are parallel
  glm::dvec3 right{0.0};   ///< sum P c
};

AxesFit fit_axes(std::span<const Camera> cameras);

}  // namespace raysplats
