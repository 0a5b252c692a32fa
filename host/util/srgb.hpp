// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

namespace raysplats {

/// The sRGB curve (IEC 61966-2-1): a display value from linear light of at least 0; it goes on
/// above 1.
template <class Real>
Real display_from_light(Real light) {
  return light <= Real(0.0031308) ? Real(12.92) * light
                                  : Real(1.055) * std::pow(light, 1 / Real(2.4)) - Real(0.055);
}

/// Its inverse; numbers below 0 keep their sign.
template <class Real>
Real light_from_display(Real value) {
  const Real size = std::abs(value);
  const Real light = size <= Real(0.04045)
                         ? size / Real(12.92)
                         : std::pow((size + Real(0.055)) / Real(1.055), Real(2.4));
  return std::copysign(light, value);
}

}  // namespace raysplats
