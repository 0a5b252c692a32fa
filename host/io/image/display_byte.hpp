// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace raysplats {

/// A colour as 8 bits: clamped to [0, 1], NaN is 0.
inline std::uint8_t display_byte(float color) {
  // Written so that NaN becomes 0.
  const float value = color > 0.0f ? std::min(color, 1.0f) : 0.0f;
  return static_cast<std::uint8_t>(std::lround(value * 255.0f));
}

}  // namespace raysplats
