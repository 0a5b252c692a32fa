// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "reference/tracer.hpp"

namespace raysplats::reference {

struct Gradient {
  Parameters parameters;  ///< dL/d(every parameter before activation), laid out as the parameters
  /// Pose: the camera's centre in world axes, and a rotation vector w in camera axes that turns the
  /// world-to-camera rotation R into exp([w]x) R about the fixed centre.
  glm::dvec3 center{0.0};
  glm::dvec3 rotation{0.0};
};

/// Analytic gradient of a loss over render() (paper, appendix A.3 to A.6; docs/model.md):
/// `image_gradient` is planar dL/dR, dL/dG, dL/dB, dL/dA, 4 x height x width. The set and order of
/// the hits are constants of differentiation; a colour's dependence on the direction camera centre
/// - mean is included.
Gradient render_gradient(const Parameters& parameters,
                         const TraceOptions& options,
                         const Camera& camera,
                         std::span<const double> image_gradient);

/// dL/dq of a quaternion of any positive length from dL/dR of rotation_matrix(q).
std::array<double, 4> quaternion_gradient(const std::array<double, 4>& quaternion,
                                          const glm::dmat3& rotation_gradient);

}  // namespace raysplats::reference
