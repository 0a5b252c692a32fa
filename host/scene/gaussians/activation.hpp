// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

namespace raysplats {

/// The opacity, or scale, of the number that is trained for it.
inline double sigmoid(double parameter) { return 1.0 / (1.0 + std::exp(-parameter)); }

/// The other way round; infinite at 0 and 1.
inline double logit(double value) { return std::log(value / (1.0 - value)); }

}  // namespace raysplats
