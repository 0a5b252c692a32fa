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

struct RayQuery {
  glm::dvec3 origin{0.0};
  glm::dvec3 direction{0.0, 0.0, 1.0};
  double t_min = 0.0;
  double t_max = 0.0;
};

/// Analytic gradient of a loss over trace_ray() of any rays: `gradients` holds dL/dR, dL/dG, dL/dB,
/// dL/dalpha of every ray, 4 x rays. A colour's dependence on the direction origin - mean is
/// included.
Parameters ray_gradient(const Parameters& parameters,
                        const TraceOptions& options,
                        std::span<const RayQuery> rays,
                        std::span<const double> gradients,
                        ColorMode color_mode);

/// dL/dq of a quaternion of any positive length from dL/dR of rotation_matrix(q).
std::array<double, 4> quaternion_gradient(const std::array<double, 4>& quaternion,
                                          const glm::dmat3& rotation_gradient);

}  // namespace raysplats::reference
