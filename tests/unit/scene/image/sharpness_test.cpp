// SPDX-License-Identifier: Apache-2.0
#include "scene/image/sharpness.hpp"

#include <doctest/doctest.h>

namespace raysplats {

TEST_CASE("sharpness is the mean square of the Laplacian, and less of what is blurred") {
  Image dot(5, 4, 3);
  for (int c = 0; c < 3; ++c) dot.at(2, 2, c) = 1.0f;
  // -4 at the dot, 1 at its neighbours that are not at the rim.
  CHECK(sharpness(dot).fine == doctest::Approx((16.0 + 3.0) / 20.0));
  Image blurred(5, 4, 3);
  for (int c = 0; c < 3; ++c) {
    blurred.at(2, 2, c) = 0.5f;
    for (const int step : {-1, 1}) blurred.at(2 + step, 2, c) = 0.25f;
  }
  CHECK(sharpness(blurred).fine < 0.5 * sharpness(dot).fine);
  CHECK(sharpness(Image(5, 4, 1, 0.7f)).fine < 1e-12);
  CHECK(sharpness(Image(1, 1, 3)).fine == 0.0);
  CHECK(sharpness(Image(1, 1, 3)).coarse == 0.0);
}

TEST_CASE("the coarse sharpness is that of squares, which blur within them leaves as it is") {
  // 75 x 50 pixels are 25 x 16 squares of three; the last two rows belong to none.
  Image square(75, 50, 1), dot(75, 50, 1);
  for (int y = 12; y < 15; ++y) {
    for (int x = 30; x < 33; ++x) square.at(x, y, 0) = 1.0f / 9.0f;
  }
  dot.at(31, 13, 0) = 1.0f;
  dot.at(40, 49, 0) = 1.0f;
  const double coarse = (16.0 + 4.0) / 81.0 / (25.0 * 16.0);
  CHECK(sharpness(square).coarse == doctest::Approx(coarse));
  CHECK(sharpness(dot).coarse == doctest::Approx(coarse));
  CHECK(sharpness(square).fine < 0.1 * sharpness(dot).fine);
}

}  // namespace raysplats
