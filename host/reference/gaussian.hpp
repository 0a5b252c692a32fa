// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "raysplats/gaussians.hpp"
#include "raysplats/trace_options.hpp"

namespace raysplats::reference {

/// The trained parameters of N Gaussians in double precision, before activation; also the layout of
/// their gradient.
struct Parameters {
  int sh_degree = 0;         ///< degree `sh` is laid out for
  int active_sh_degree = 0;  ///< bands above this are not evaluated
  ScaleActivation activation = ScaleActivation::kExp;
  std::vector<double> means;        ///< 3 N
  std::vector<double> quaternions;  ///< 4 N, real part first
  std::vector<double> scales;       ///< 3 N: log-scale for kExp, logit of the scale for kSigmoid
  std::vector<double> opacities;    ///< N, logits
  std::vector<double> sh;           ///< N x coefficients x 3 (RGB innermost)

  Parameters() = default;
  /// For kSigmoid the model's scales must be below 1; throws UsageError otherwise.
  explicit Parameters(const Gaussians& model, ScaleActivation activation = ScaleActivation::kExp);

  std::size_t size() const { return opacities.size(); }
  /// Number of scalars of all groups together.
  std::size_t scalar_count() const;
  /// Scalar `flat` of the concatenation means, quaternions, scales, opacities, sh.
  double& at(std::size_t flat);
  double at(std::size_t flat) const;
  /// The same layout with every number zero.
  Parameters zeros() const;

  glm::dvec3 mean(std::size_t i) const {
    return {means[3 * i], means[3 * i + 1], means[3 * i + 2]};
  }
};

double sigmoid(double x);

/// Standard deviation of a scale parameter.
double activated_scale(double parameter, ScaleActivation activation);

/// Rotation matrix of a quaternion (real part first) of any positive length.
glm::dmat3 rotation_matrix(const std::array<double, 4>& quaternion);

/// M = S^-1 R^T of Gaussian i.
glm::dmat3 whitening_matrix(const Parameters& parameters, std::size_t i);

/// Q of a Gaussian (docs/model.md): the option, or with an adaptive radius min(Q, 2 ln(255
/// opacity)), negative when no ray can meet it.
double effective_quantile(const TraceOptions& options, double opacity);

/// Real spherical harmonics of degree 0..4 at a unit direction with the signs of Sloan 2008 and
/// 3DGS; entries above `degree` are zero.
std::array<double, 25> sh_basis(int degree, const glm::dvec3& direction);

/// Derivatives of sh_basis with x, y, z as three free variables.
std::array<glm::dvec3, 25> sh_basis_gradient(int degree, const glm::dvec3& direction);

/// max(0, 0.5 + sum of basis times coefficient) of Gaussian i seen along a unit direction.
glm::dvec3 color(const Parameters& parameters, std::size_t i, const glm::dvec3& direction);

}  // namespace raysplats::reference
