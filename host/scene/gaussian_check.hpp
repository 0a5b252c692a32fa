// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "raysplats/gaussians.hpp"

namespace raysplats {

/// Throws UsageError when the degree is not 0 to kMaxShDegree.
void check_sh_degree(int degree);

/// Throws UsageError when the arrays do not fit each other or the SH degree is not 0 to 4.
void check_sizes(const Gaussians& gaussians);

/// The same, and DataError when a number is not finite.
void check_gaussians(const Gaussians& gaussians);

}  // namespace raysplats
