// SPDX-License-Identifier: Apache-2.0
#include "reference/ssim.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "raysplats/error.hpp"
#include "scene/image/pixel_count.hpp"
#include "util/rng.hpp"

using namespace raysplats;
using namespace raysplats::reference;

namespace {

std::vector<double> noise(std::size_t size, std::uint64_t seed) {
  CounterRng rng(seed, 4);
  std::vector<double> out(size);
  for (double& x : out) x = rng.uniform();
  return out;
}

}  // namespace

TEST_CASE("SSIM of an image with itself is one and is symmetric") {
  const auto a = noise(20 * 17, 1), b = noise(20 * 17, 2);
  for (const double s : ssim(a, a, 20, 17).map) CHECK(s == doctest::Approx(1.0).epsilon(1e-12));
  CHECK(ssim(a, b, 20, 17).mean == doctest::Approx(ssim(b, a, 20, 17).mean).epsilon(1e-13));
  CHECK(ssim(a, b, 20, 17).mean < 0.5);
  CHECK(ssim(a, b, 20, 17).map.size() == 20 * 17);
}

TEST_CASE("SSIM of two constant images is their luminance term away from the border") {
  const int size = 15;
  const std::vector<double> a(size * size, 0.3), b(size * size, 0.7);
  const Ssim s = ssim(a, b, size, size);
  const double expected = (2 * 0.3 * 0.7 + 1e-4) / (0.3 * 0.3 + 0.7 * 0.7 + 1e-4);
  CHECK(s.map[7 * size + 7] == doctest::Approx(expected).epsilon(1e-10));
  // At the border the zeros outside are seen: both images vary alike there, in proportion 3 : 7.
  CHECK(s.map[0] != doctest::Approx(expected).epsilon(1e-3));
}

TEST_CASE("one pixel has the closed form of its window weight") {
  double sum = 0.0;
  for (int y = -5; y <= 5; ++y) {
    for (int x = -5; x <= 5; ++x) sum += std::exp(-(x * x + y * y) / 4.5);
  }
  const double w = 1.0 / sum, i = 0.8, t = 0.5;
  const double mi = w * i, mt = w * t;
  const double expected = (2 * mi * mt + 1e-4) / (mi * mi + mt * mt + 1e-4) *
                          (2 * (w * i * t - mi * mt) + 9e-4) /
                          (w * i * i - mi * mi + w * t * t - mt * mt + 9e-4);
  CHECK(ssim(std::vector<double>{i}, std::vector<double>{t}, 1, 1).mean ==
        doctest::Approx(expected).epsilon(1e-12));
}

TEST_CASE("the gradient of SSIM equals finite differences") {
  for (const auto& [width, height] :
       {std::pair(13, 14), std::pair(5, 3), std::pair(1, 1), std::pair(23, 2)}) {
    const std::size_t size = pixel_count(width, height);
    auto image = noise(size, 3);
    const auto target = noise(size, 4);
    const auto gradient = ssim_gradient(image, target, width, height);
    constexpr double kStep = 1e-6;
    for (std::size_t p = 0; p < size; ++p) {
      const double value = image[p];
      image[p] = value + kStep;
      const double plus = ssim(image, target, width, height).mean;
      image[p] = value - kStep;
      const double minus = ssim(image, target, width, height).mean;
      image[p] = value;
      const double numeric = (plus - minus) / (2.0 * kStep);
      CHECK(std::abs(gradient[p] - numeric) <= 1e-6 * (std::abs(numeric) + 1e-3));
    }
  }
}

TEST_CASE("PSNR is minus ten times the logarithm of the mean squared error") {
  const std::vector<double> a{0.1, 0.2, 0.3, 0.4}, b{0.2, 0.1, 0.4, 0.3};
  CHECK(psnr(a, b) == doctest::Approx(20.0));
  CHECK(std::isinf(psnr(a, a)));
}

TEST_CASE("images of different sizes are refused") {
  const auto a = noise(12, 1), b = noise(8, 2);
  CHECK_THROWS_AS(ssim(a, b, 4, 3), UsageError);
  CHECK_THROWS_AS(ssim_gradient(a, a, 5, 3), UsageError);
  CHECK_THROWS_AS(psnr(a, b), UsageError);
}
