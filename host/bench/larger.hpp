// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

namespace raysplats {

/// The larger of two numbers; what is no number is larger than all others and stays.
inline double larger(double a, double b) { return std::isnan(a) || a > b ? a : b; }

}  // namespace raysplats
