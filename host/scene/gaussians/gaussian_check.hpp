// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "raysplats/gaussians.hpp"

namespace raysplats {

/// Shorter and longer quaternions are no rotations: their squares leave single precision.
constexpr double kShortestQuaternion = 1e-15;
constexpr double kLongestQuaternion = 1e15;

/// Throws UsageError when the degree is not 0 to kMaxShDegree.
void check_sh_degree(int degree);

/// Throws UsageError when the arrays do not fit each other or the SH degree is not 0 to 4.
void check_sizes(const Gaussians& gaussians);

/// The same, and DataError when a number is not finite or a quaternion no rotation.
void check_gaussians(const Gaussians& gaussians);

}  // namespace raysplats
