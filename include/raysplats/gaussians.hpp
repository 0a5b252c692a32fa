// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

namespace raysplats {

/// Highest degree of spherical harmonics that a model may have.
constexpr int kMaxShDegree = 4;

/// Number of spherical-harmonics coefficients per channel of a degree (0..4).
constexpr int sh_coefficients(int degree) { return (degree + 1) * (degree + 1); }

/// A scene of N Gaussians on the host, as it is stored in a 3DGS PLY: parameters before activation.
struct Gaussians {
  int sh_degree = 0;               ///< 0..4
  std::vector<float> means;        ///< 3 N, world units
  std::vector<float> quaternions;  ///< 4 N, real part first, normalised when used
  std::vector<float> log_scales;   ///< 3 N, natural logarithm of the standard deviations
  std::vector<float> opacities;    ///< N, logit of the opacity
  std::vector<float> sh;           ///< N x coefficients x 3 (RGB innermost)

  /// Number of Gaussians.
  std::size_t size() const { return opacities.size(); }
  /// Sets the number of Gaussians; new ones are zero apart from unit quaternions.
  void resize(std::size_t count);
};

/// Adds or drops bands so that the model has `degree`; new coefficients are zero. Throws UsageError
/// when the degree is not 0 to 4, or the arrays of the model do not fit each other.
Gaussians with_sh_degree(const Gaussians& model, int degree);

}  // namespace raysplats
