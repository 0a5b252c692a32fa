// SPDX-License-Identifier: Apache-2.0
// The shift in the plane that brings a picture closest to its photo.
#include "eval/shift_fit.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <random>

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
  }
}

TEST_CASE("the gain is that of the pixels that have a place in the picture, shifted or not") {
  const Image photo = waves(0, 0);
  Image picture = waves(-5, -3);
  std::mt19937 random(7);
  for (float& number : picture.data)
    number += 0.1f * (static_cast<float>(random() % 1000) / 1000.0f - 0.5f);
  double before = 0, after = 0;
  for (int y = 1; y + 5 < kHeight; ++y) {
    for (int x = 1; x + 7 < kWidth; ++x) {
      for (int c = 0; c < 3; ++c) {
        const auto wanted = static_cast<double>(photo.at(x, y, c));
        before += std::pow(static_cast<double>(picture.at(x, y, c)) - wanted, 2);
        after += std::pow(static_cast<double>(picture.at(x + 5, y + 3, c)) - wanted, 2);
      }
    }
  }
  // Between pixels noise is less, by as much as the shift found is off a whole one.
  const ShiftFit fit = fit_shift(picture, photo, all_count(photo));
  CHECK(std::abs(fit.gain - 10 * std::log10(before / after)) < 0.5);
  CHECK(glm::length(fit.shift - glm::dvec2(5, 3)) < 0.05);
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
