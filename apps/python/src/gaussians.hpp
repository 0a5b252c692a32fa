// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "arrays.hpp"
#include "raysplats/gaussians.hpp"

namespace raysplats::python {

/// Copies five arrays of N Gaussians; the number of coefficients of `sh` gives the degree. Throws
/// UsageError when they do not fit each other.
Gaussians gaussians_of(const FloatArray& means,
                       const FloatArray& quaternions,
                       const FloatArray& log_scales,
                       const FloatArray& opacities,
                       const FloatArray& sh);

}  // namespace raysplats::python
