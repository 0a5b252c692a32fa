// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cmath>

#include "raysplats/train_options.hpp"

namespace raysplats {

std::int64_t RunShare::of(std::int64_t iterations) const {
  if (value <= 0) return 0;
  if (value >= 1) return static_cast<std::int64_t>(value);
  return std::max<std::int64_t>(1, std::llround(value * static_cast<double>(iterations)));
}

}  // namespace raysplats
