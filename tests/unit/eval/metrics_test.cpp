// SPDX-License-Identifier: Apache-2.0
#include "eval/metrics.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>

#include "eval/error_map.hpp"
#include "raysplats/error.hpp"

namespace raysplats {
namespace {

struct Pair {
  Image a, b;
};

// The constants below come from scikit-image 0.26.0 and these lines:
//   import numpy as np
//   from skimage.metrics import structural_similarity, peak_signal_noise_ratio
//   def pair(h, w):
//       y, x, c = np.mgrid[0:h, 0:w, 0:3].astype(np.float64)
//       a = 0.5 + 0.4 * np.sin(0.3 * x + c) * np.cos(0.2 * y)
//       b = np.clip(a + 0.1 * np.sin(1.7 * x + 0.9 * y * y + 2.0 * c) + 0.05, 0, 1)
//       return a, b
//   for h, w in ((24, 31), (11, 11), (40, 17)):
//       a, b = pair(h, w)
//       print(h, w, structural_similarity(a, b, gaussian_weights=True, sigma=1.5,
//                                         use_sample_covariance=False, data_range=1,
//                                         channel_axis=-1),
//             peak_signal_noise_ratio(a, b, data_range=1))
Pair make_pair(int height, int width) {
  Pair out{Image(width, height, 3), Image(width, height, 3)};
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      for (int c = 0; c < 3; ++c) {
        const double a = 0.5 + 0.4 * std::sin(0.3 * x + c) * std::cos(0.2 * y);
        const double b = a + 0.1 * std::sin(1.7 * x + 0.9 * y * y + 2.0 * c) + 0.05;
        out.a.at(x, y, c) = static_cast<float>(a);
        out.b.at(x, y, c) = static_cast<float>(std::clamp(b, 0.0, 1.0));
      }
    }
  }
  return out;
}

// The mean of SSIM by the weights of the pixels that lie `border` from the borders, from windows of
// 11 x 11 weights whose means are of deviations; edges are repeated.
double ssim_by_pixel(const Pair& pair, const Image& weight, int border) {
  const auto mirrored = [](int i, int n) { return i < 0 ? -1 - i : i < n ? i : 2 * n - 1 - i; };
  double window[11], sum = 0;
  for (int i = 0; i < 11; ++i) sum += window[i] = std::exp(-0.5 * (i - 5) * (i - 5) / (1.5 * 1.5));
  double total = 0, weights = 0;
  for (int y = border; y < weight.height - border; ++y) {
    for (int x = border; x < weight.width - border; ++x) {
      const auto w = static_cast<double>(weight.at(x, y, 0));
      for (int c = 0; c < 3; ++c) {
        // Calls use(weight, a, b) for all of the window.
        const auto windowed = [&](const auto& use) {
          for (int j = -5; j <= 5; ++j) {
            for (int i = -5; i <= 5; ++i) {
              const int u = mirrored(x + i, weight.width), v = mirrored(y + j, weight.height);
              use(window[i + 5] * window[j + 5] / (sum * sum),
                  static_cast<double>(pair.a.at(u, v, c)), static_cast<double>(pair.b.at(u, v, c)));
            }
          }
        };
        double a = 0, b = 0, aa = 0, bb = 0, ab = 0;
        windowed([&](double k, double p, double q) { a += k * p, b += k * q; });
        windowed([&](double k, double p, double q) {
          aa += k * (p - a) * (p - a), bb += k * (q - b) * (q - b), ab += k * (p - a) * (q - b);
        });
        total +=
            w * (2 * a * b + 1e-4) * (2 * ab + 9e-4) / ((a * a + b * b + 1e-4) * (aa + bb + 9e-4));
      }
      weights += 3 * w;
    }
  }
  return total / weights;
}

}  // namespace

TEST_CASE("metrics: SSIM and PSNR equal scikit-image's") {
  struct Row {
    int height, width;
    double ssim, psnr;
  };
  for (const Row& row : {Row{24, 31, 0.7730406983287672, 21.28047430186107},
                         Row{11, 11, 0.7778038701830804, 21.276702769016993},
                         Row{40, 17, 0.776214761429232, 21.283908342315293}}) {
    CAPTURE(row.height);
    const Pair pair = make_pair(row.height, row.width);
    CHECK(ssim(pair.a, pair.b) == doctest::Approx(row.ssim).epsilon(1e-6));
    CHECK(ssim(pair.b, pair.a) == doctest::Approx(row.ssim).epsilon(1e-6));
    CHECK(psnr(pair.a, pair.b) == doctest::Approx(row.psnr).epsilon(1e-6));
  }
}

TEST_CASE("metrics: closed forms") {
  // Constant images have no variance: SSIM is the luminance term alone, PSNR the squared distance.
  const Image a(20, 13, 3, 0.25f);
  const Image b(20, 13, 3, 0.75f);
  CHECK(ssim(a, b) ==
        doctest::Approx((2 * 0.25 * 0.75 + 1e-4) / (0.0625 + 0.5625 + 1e-4)).epsilon(1e-9));
  CHECK(psnr(a, b) == doctest::Approx(20 * std::log10(2.0)).epsilon(1e-9));
  CHECK(ssim(a, a) == doctest::Approx(1).epsilon(1e-12));
  CHECK(std::isinf(psnr(a, a)));
  // Smaller than the window, down to one pixel: still the mean over the pixels.
  for (const int size : {1, 2, 3, 7}) {
    CHECK(ssim(Image(size, 2 * size, 1, 0.25f), Image(size, 2 * size, 1, 0.75f)) ==
          doctest::Approx(ssim(a, b)).epsilon(1e-9));
  }
}

TEST_CASE("metrics: SSIM by weights is the mean of each pixel's own, in one and in many bands") {
  for (const int height : {17, 150}) {
    CAPTURE(height);
    constexpr int kWidth = 24;
    const Pair pair = make_pair(height, kWidth);
    Image weight(kWidth, height, 1);
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < kWidth; ++x) weight.at(x, y, 0) = static_cast<float>((x * y) % 3) / 2.0f;
    }
    const double all = ssim(pair.a, pair.b);
    const double some = weighted_ssim(pair.a, pair.b, weight);
    CHECK(all ==
          doctest::Approx(ssim_by_pixel(pair, Image(kWidth, height, 1, 1.0f), 5)).epsilon(1e-10));
    CHECK(some == doctest::Approx(ssim_by_pixel(pair, weight, 5)).epsilon(1e-10));
    CHECK(std::abs(some - all) > 1e-4);
    CHECK(weighted_ssim(pair.a, pair.b, Image(kWidth, height, 1, 0.25f)) ==
          doctest::Approx(all).epsilon(1e-12));
    // All weight along the borders, which are left out of others.
    Image edge(kWidth, height, 1);
    edge.at(2, 3, 0) = 1.0f;
    CHECK(weighted_ssim(pair.a, pair.b, edge) ==
          doctest::Approx(ssim_by_pixel(pair, edge, 0)).epsilon(1e-10));
    CHECK_THROWS_AS(weighted_ssim(pair.a, pair.b, Image(kWidth, height, 1)), UsageError);
  }
}

TEST_CASE("metrics: images of different size are refused") {
  CHECK_THROWS_AS(psnr(Image(3, 4, 3), Image(4, 3, 3)), UsageError);
  CHECK_THROWS_AS(ssim(Image(3, 4, 3), Image(3, 4, 1)), UsageError);
  CHECK_THROWS_AS(psnr(Image(), Image()), UsageError);
  CHECK_THROWS_AS(error_map(Image(3, 4, 3), Image(4, 3, 3)), UsageError);
  CHECK_THROWS_AS(error_map(Image(3, 4, 1), Image(3, 4, 1)), UsageError);
}

TEST_CASE("error map: black, red, yellow, white, and the picture shows photo, render and error") {
  Image photo(4, 2, 3, 0.5f);
  Image render = photo;
  const float steps[] = {0.0f, 1.0f / 12, 1.0f / 6, 0.4f};
  for (int x = 0; x < 4; ++x) {
    for (int c = 0; c < 3; ++c) render.at(x, 1, c) += (c == 1 ? -1.0f : 1.0f) * steps[x];
  }
  const Image map = error_map(render, photo);
  const float expected[4][3] = {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {1, 1, 1}};
  for (int x = 0; x < 4; ++x) {
    for (int c = 0; c < 3; ++c) {
      CHECK(map.at(x, 0, c) == 0.0f);
      CHECK(map.at(x, 1, c) == doctest::Approx(expected[x][c]).epsilon(1e-5));
    }
  }
  const Image picture = side_by_side(photo, render);
  REQUIRE(picture.width == 12);
  REQUIRE(picture.height == 2);
  for (int x = 0; x < 4; ++x) {
    CHECK(picture.at(x, 1, 0) == photo.at(x, 1, 0));
    CHECK(picture.at(4 + x, 1, 0) == render.at(x, 1, 0));
    CHECK(picture.at(8 + x, 1, 0) == map.at(x, 1, 0));
  }
}

TEST_CASE("corrected PSNR: an affine colour does not count, what it cannot make does") {
  const Pair pair = make_pair(20, 24);
  Image photo(24, 20, 3);
  const double matrix[3][4] = {
      {0.7, 0.1, -0.05, 0.06}, {0.05, 0.6, 0.1, 0.1}, {-0.1, 0.05, 0.9, 0.05}};
  for (int y = 0; y < 20; ++y) {
    for (int x = 0; x < 24; ++x) {
      for (int c = 0; c < 3; ++c) {
        double sum = matrix[c][3];
        for (int k = 0; k < 3; ++k) sum += matrix[c][k] * static_cast<double>(pair.a.at(x, y, k));
        photo.at(x, y, c) = static_cast<float>(sum);
      }
    }
  }
  Image weight(24, 20, 1, 1.0f);
  CHECK(psnr(pair.a, photo) < 25);
  CHECK(corrected_psnr(pair.a, photo, weight) > 90);
  // A corner that is masked out changes nothing, however wrong it is; one that counts does.
  Image spoiled = pair.a;
  for (int x = 0; x < 6; ++x) {
    for (int c = 0; c < 3; ++c) spoiled.at(x, 3, c) = 1.0f - spoiled.at(x, 3, c);
    weight.at(x, 3, 0) = 0.0f;
  }
  CHECK(corrected_psnr(spoiled, photo, weight) > 90);
  CHECK(corrected_psnr(spoiled, photo, Image(24, 20, 1, 1.0f)) < 40);
  // Never worse than the plain one but for the ridge, and finite where one colour leaves it open.
  CHECK(corrected_psnr(pair.a, pair.b, Image(24, 20, 1, 1.0f)) > psnr(pair.a, pair.b) - 1e-3);
  const Image grey(24, 20, 3, 0.5f);
  CHECK(std::isfinite(corrected_psnr(grey, photo, weight)));
  CHECK_THROWS_AS(corrected_psnr(pair.a, photo, Image(24, 20, 1)), UsageError);
}

TEST_CASE("PSNR by weights: even ones change nothing, and pixels without one do not count") {
  const Pair pair = make_pair(20, 24);
  CHECK(weighted_psnr(pair.a, pair.b, Image(24, 20, 1, 1.0f)) ==
        doctest::Approx(psnr(pair.a, pair.b)).epsilon(1e-12));
  CHECK(weighted_psnr(pair.a, pair.b, Image(24, 20, 1, 0.25f)) ==
        doctest::Approx(psnr(pair.a, pair.b)).epsilon(1e-12));
  Image photo = pair.a;
  Image weight(24, 20, 1, 1.0f);
  photo.at(3, 4, 1) += 0.5f;
  photo.at(9, 9, 0) += 0.7f;
  weight.at(9, 9, 0) = 0.0f;
  CHECK(weighted_psnr(pair.a, photo, weight) ==
        doctest::Approx(-10 * std::log10(0.25 / (3 * 479))).epsilon(1e-5));
}

}  // namespace raysplats
