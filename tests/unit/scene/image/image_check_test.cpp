// SPDX-License-Identifier: Apache-2.0
#include "scene/image/image_check.hpp"

#include <doctest/doctest.h>

#include "unit/text.hpp"

using namespace raysplats;
using namespace raysplats::test;

TEST_CASE("an image whose numbers are not those of its size is refused") {
  check_image(Image(3, 2, 4), "It");
  for (const Image& image : {Image{}, Image(3, 2, 0), Image(0, 2, 3)})
    CHECK_THROWS_AS(check_image(image, "It"), UsageError);
  Image image(3, 2, 4);
  image.data.pop_back();
  CHECK(message_of<UsageError>([&] { check_image(image, "It"); }) ==
        "It of 3 x 2 pixels and 4 channels has 23 numbers: give one for every channel of every "
        "pixel");
  image.width = image.height = -3;  // whose product is one of pixels
  CHECK_THROWS_AS(check_image(image, "It"), UsageError);
}
