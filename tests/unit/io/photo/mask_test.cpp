// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "io/photo/photo_rows.hpp"

using namespace raysplats;

namespace {

template <class T>
std::vector<float> mask_of(int channels, std::vector<T> numbers) {
  const int width = static_cast<int>(numbers.size()) / channels;
  return io::mask_plane({width, 1, channels, std::move(numbers)}).values;
}

using Bytes = std::vector<std::uint8_t>;
using Shorts = std::vector<std::uint16_t>;
using Floats = std::vector<float>;

}  // namespace

TEST_CASE("a mask of 0 and 1 is one of black and white, in 8 bits as in 16") {
  const Floats binary{0, 1, 1, 0};
  CHECK(mask_of(1, Bytes{0, 1, 1, 0}) == binary);
  CHECK(mask_of(1, Shorts{0, 1, 1, 0}) == binary);
  CHECK(mask_of(1, Shorts{0, 257, 257, 0}) == binary);  // of 8 bits, widened
  CHECK(mask_of(3, Bytes{0, 0, 0, 0, 1, 0}) == Floats{0, 1});
  CHECK(mask_of(2, Bytes{1, 1, 1, 0}) == Floats{1, 0});
  CHECK(mask_of(2, Bytes{1, 255, 1, 0}) == Floats{1, 0});
  // Floats of a codec that has no others (Python's).
  CHECK(mask_of(1, Floats{0, 1.0f / 255.0f}) == Floats{0, 1});
  CHECK(mask_of(1, Bytes{0, 128, 255})[1] == 128.0f / 255.0f);
  CHECK(mask_of(1, Floats{0, 0.5f, 7.0f}) == Floats{0, 0.5f, 1});
  CHECK(mask_of(1, Bytes{0, 0}) == Floats{0, 0});
}

TEST_CASE("labels of several objects, whole numbers far below white, count whole") {
  CHECK(mask_of(1, Bytes{0, 1, 2}) == Floats{0, 1, 1});
  CHECK(mask_of(1, Bytes{0, 2, 0}) == Floats{0, 1, 0});
  CHECK(mask_of(1, Bytes{31, 0, 7}) == Floats{1, 0, 1});
  CHECK(mask_of(1, Shorts{0, 3, 31}) == Floats{0, 1, 1});
  CHECK(mask_of(1, Shorts{0, 2 * 257, 31 * 257}) == Floats{0, 1, 1});
  CHECK(mask_of(1, Floats{0, 2.0f / 255.0f, 3.0f / 255.0f}) == Floats{0, 1, 1});
  // Lighter numbers, and those between whole ones, are greys, which are shares.
  CHECK(mask_of(1, Bytes{0, 1, 32}) == Floats{0, 1.0f / 255.0f, 32.0f / 255.0f});
  CHECK(mask_of(1, Shorts{0, 32, 300}) == Floats{0, 32.0f / 65535.0f, 300.0f / 65535.0f});
  CHECK(mask_of(1, Floats{0, 0.05f}) == Floats{0, 0.05f});
  // Black as videos have it is no label.
  CHECK(mask_of(1, Bytes{16, 16}) == Floats{16.0f / 255.0f, 16.0f / 255.0f});
  CHECK(mask_of(1, Bytes{1, 1}) == Floats{1, 1});
}

TEST_CASE("a black mask with a shape in its alpha is that shape") {
  const auto is_black = [](int channels, Bytes numbers) {
    const int width = static_cast<int>(numbers.size()) / channels;
    return io::is_black({width, 1, channels, std::move(numbers)});
  };
  const Bytes shape{0, 0, 0, 255, 0, 0, 0, 0, 0, 0, 0, 51};
  CHECK(mask_of(4, shape) == Floats{1, 0, 51.0f / 255.0f});
  CHECK_FALSE(is_black(4, shape));
  CHECK(mask_of(2, Bytes{0, 1, 0, 0}) == Floats{1, 0});
  // Alpha that is the same everywhere has no shape.
  CHECK(mask_of(4, Bytes{0, 0, 0, 255, 0, 0, 0, 255}) == Floats{0, 0});
  CHECK(is_black(4, Bytes{0, 0, 0, 255, 0, 0, 0, 255}));
  CHECK(is_black(2, Bytes{0, 0, 0, 0}));
}

TEST_CASE("a mask is black where no pixel has both colour and alpha") {
  const auto is_black = [](int channels, auto numbers) {
    const int width = static_cast<int>(numbers.size()) / channels;
    return io::is_black({width, 1, channels, std::move(numbers)});
  };
  CHECK(is_black(1, Bytes{0, 0, 0}));
  CHECK_FALSE(is_black(1, Bytes{0, 0, 1}));
  CHECK_FALSE(is_black(3, Shorts{0, 0, 0, 0, 0, 1}));
  CHECK(is_black(2, Bytes{255, 0, 0, 255}));
  CHECK(is_black(4, Bytes{9, 9, 9, 0, 0, 0, 0, 9}));
  CHECK_FALSE(is_black(4, Bytes{9, 9, 9, 0, 0, 9, 0, 9}));
  CHECK(is_black(1, Floats{0.0f, -1.0f, std::numeric_limits<float>::quiet_NaN()}));
}

TEST_CASE("a mask is what is not black: the greatest of its colours, times its alpha") {
  // White with the shape in alpha, green on black, grey with alpha.
  CHECK(mask_of(4, Bytes{255, 255, 255, 255, 255, 255, 255, 0}) == Floats{1, 0});
  CHECK(mask_of(3, Bytes{0, 255, 0, 0, 0, 0, 10, 0, 51}) == Floats{1, 0, 51.0f / 255.0f});
  CHECK(mask_of(2, Shorts{65535, 65535, 65535, 0, 0, 65535}) == Floats{1, 0, 0});
  CHECK(mask_of(4, Floats{0, 0.5f, 0, 0.5f}) == Floats{0.25f});
}
