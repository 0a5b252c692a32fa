// SPDX-License-Identifier: Apache-2.0
// The shift in the plane that brings a picture closest to its photo.
#include "eval/shift_fit.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <glm/geometric.hpp>

#include "eval/metrics.hpp"

using namespace raysplats;

namespace {

constexpr int kWidth = 160, kHeight = 120;

// Waves of several lengths and directions, known between pixels as well, each channel its own.
Image waves(double right, double down, int width = kWidth, int height = kHeight) {
  Image out(width, height, 3);
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const double u = x + right, v = y + down;
      for (int c = 0; c < 3; ++c) {
        out.at(x, y, c) = static_cast<float>(0.5 + 0.2 * std::sin(0.11 * u + 0.07 * v + c) +
                                             0.15 * std::cos(0.31 * u - 0.23 * v) +
                                             0.1 * std::sin(0.05 * u - 0.4 * v + 0.5 * c));
      }
    }
  }
  return out;
}

Image all_count(const Image& like) { return Image(like.width, like.height, 1, 1.0f); }

}  // namespace

TEST_CASE("a shifted picture is found where it fits its photo") {
  const Image photo = waves(0, 0);
  for (const glm::dvec2 shift : {glm::dvec2(0.3, -0.2), glm::dvec2(-1.4, 2.6), glm::dvec2(5, 3)}) {
    CAPTURE(shift.x);
    const Image picture = waves(-shift.x, -shift.y);
    const ShiftFit fit = fit_shift(picture, photo, all_count(photo));
    CHECK(glm::length(fit.shift - shift) < 0.05);
    CHECK(fit.gain > 15);
    // Whole pixels can be moved by hand: as many decibels, of the same pixels.
    if (shift.x != 5) continue;
    const auto part = [&](const Image& image, int right, int down) {
      Image out(kWidth - 12, kHeight - 12, 3);
      for (int y = 0; y < out.height; ++y) {
        for (int x = 0; x < out.width; ++x) {
          for (int c = 0; c < 3; ++c) out.at(x, y, c) = image.at(x + 2 + right, y + 2 + down, c);
        }
      }
      return out;
    };
    CHECK(psnr(part(picture, 5, 3), part(photo, 0, 0)) >
          psnr(part(picture, 0, 0), part(photo, 0, 0)) + 15);
  }
}

TEST_CASE(
    "nothing is gained by shifting a picture that fits, shows nothing or shows something else") {
  const Image photo = waves(0, 0);
  CHECK(fit_shift(photo, photo, all_count(photo)).gain == 0);
  Image soft = photo;  // each pixel the mean of five: errors without a direction
  for (int y = 1; y + 1 < kHeight; ++y) {
    for (int x = 1; x + 1 < kWidth; ++x) {
      for (int c = 0; c < 3; ++c) {
        soft.at(x, y, c) = (photo.at(x, y, c) + photo.at(x - 1, y, c) + photo.at(x + 1, y, c) +
                            photo.at(x, y - 1, c) + photo.at(x, y + 1, c)) /
                           5;
      }
    }
  }
  CHECK(fit_shift(soft, photo, all_count(photo)).gain < 0.05);
  const Image grey(kWidth, kHeight, 3, 0.4f);
  CHECK(fit_shift(grey, photo, all_count(photo)).gain == 0);
  CHECK(fit_shift(photo, grey, all_count(photo)).gain < 3);
  CHECK(fit_shift(photo, waves(0, 0), Image(kWidth, kHeight, 1)).gain == 0);
  const Image tiny = waves(0, 0, 2, 2);
  CHECK(fit_shift(tiny, tiny, all_count(tiny)).gain == 0);
}

TEST_CASE("what does not count has no say in the shift") {
  const Image photo = waves(0, 0);
  Image picture = waves(-1, 0.5);
  Image weight = all_count(photo);
  // The right half is moved the other way and does not count.
  const Image other = waves(2, -1);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = kWidth / 2; x < kWidth; ++x) {
      for (int c = 0; c < 3; ++c) picture.at(x, y, c) = other.at(x, y, c);
      weight.at(x, y, 0) = 0;
    }
  }
  CHECK(glm::length(fit_shift(picture, photo, weight).shift - glm::dvec2(1, -0.5)) < 0.25);
  CHECK(glm::length(fit_shift(picture, photo, all_count(photo)).shift - glm::dvec2(1, -0.5)) > 0.3);
}
