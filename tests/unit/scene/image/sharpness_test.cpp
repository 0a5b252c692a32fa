// SPDX-License-Identifier: Apache-2.0
#include "scene/image/sharpness.hpp"

#include <doctest/doctest.h>

namespace raysplats {

TEST_CASE("sharpness is the mean square of the Laplacian, and less of what is blurred") {
  Image dot(5, 4, 3);
  for (int c = 0; c < 3; ++c) dot.at(2, 2, c) = 1.0f;
  // -4 at the dot, 1 at its neighbours that are not at the rim.
  CHECK(sharpness(dot) == doctest::Approx((16.0 + 3.0) / 20.0));
  Image blurred(5, 4, 3);
  for (int c = 0; c < 3; ++c) {
    blurred.at(2, 2, c) = 0.5f;
    for (const int step : {-1, 1}) blurred.at(2 + step, 2, c) = 0.25f;
  }
  CHECK(sharpness(blurred) < 0.5 * sharpness(dot));
  CHECK(sharpness(Image(5, 4, 1, 0.7f)) < 1e-12);
  CHECK(sharpness(Image(1, 1, 3)) == 0.0);
}

}  // namespace raysplats
