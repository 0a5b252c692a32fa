// SPDX-License-Identifier: Apache-2.0
#include "train/loss/image_loss.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "raysplats/error.hpp"
#include "reference/ssim.hpp"
#include "scene/image/pixel_count.hpp"
#include "unit/failed_allocation.hpp"
#include "unit/fixture.hpp"
#include "util/rng.hpp"

namespace raysplats {
namespace {

Context& context() {
  // Not static: at the end of the program it has to go before what a driver keeps per thread.
  thread_local Context instance(test_device());
  return instance;
}

struct Scene {
  int width = 0;
  int height = 0;
  std::vector<float> image;           // planar R, G, B, A
  std::vector<std::uint32_t> target;  // packed
  bool alpha_is_background = false;
  std::array<float, 3> background{0, 0, 0};
  int planes = 1;
  bool weighted = false;

  std::size_t pixels() const { return pixel_count(width, height); }
};

// Smooth image with noise and a photo that differs from it; alpha in whole steps and between.
Scene make_scene(int width, int height, std::uint64_t seed, bool random_alpha) {
  Scene s;
  s.width = width;
  s.height = height;
  const std::size_t pixels = pixel_count(width, height);
  s.image.resize(4 * pixels);
  s.target.resize(pixels);
  CounterRng rng(seed, 1);
  for (std::size_t i = 0; i < pixels; ++i) {
    const double x = static_cast<double>(i % static_cast<std::size_t>(width));
    const double y = static_cast<double>(i / static_cast<std::size_t>(width));
    std::uint32_t packed = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      const double base =
          0.5 + 0.3 * std::sin(0.2 * x + static_cast<double>(c)) * std::cos(0.15 * y);
      s.image[c * pixels + i] = static_cast<float>(base + 0.15 * (rng.uniform() - 0.5));
      const double photo = std::clamp(base + 0.3 * (rng.uniform() - 0.5), 0.0, 1.0);
      packed |= static_cast<std::uint32_t>(std::lround(photo * 255)) << (8 * c);
    }
    s.image[3 * pixels + i] = static_cast<float>(rng.uniform());
    const double draw = rng.uniform();
    const std::uint32_t alpha = !random_alpha ? 255u
                                : draw < 0.3  ? 0u
                                : draw < 0.6  ? 255u
                                              : static_cast<std::uint32_t>(draw * 255);
    s.target[i] = packed | alpha << 24;
  }
  return s;
}

// A number of the photo, by the layout of cl/train/photo.h.
double photo_channel(const Scene& s, std::size_t pixel, std::size_t c) {
  if (s.planes == 1) return (s.target[pixel] >> (8 * c) & 255u) / 255.0;
  if (s.planes == 2)
    return (s.target[c / 2 * s.pixels() + pixel] >> (16 * (c % 2)) & 65535u) / 65535.0;
  return static_cast<double>(std::bit_cast<float>(s.target[c * s.pixels() + pixel]));
}

double photo_value(const Scene& s, std::size_t pixel, std::size_t c) {
  const double value = photo_channel(s, pixel, c);
  const double alpha = photo_channel(s, pixel, 3);
  return s.alpha_is_background ? value * alpha + static_cast<double>(s.background[c]) * (1 - alpha)
                               : value;
}

double photo_weight(const Scene& s, std::size_t pixel) {
  if (s.weighted) {
    const std::uint32_t word = s.target[static_cast<std::size_t>(s.planes) * s.pixels() + pixel];
    return s.planes == 4 ? static_cast<double>(std::bit_cast<float>(word)) : word / 255.0;
  }
  return s.alpha_is_background ? 1.0 : photo_channel(s, pixel, 3);
}

// The photo with more precise numbers: what no 8 bits can hold is added to its colours.
Scene with_planes(const Scene& s, int planes) {
  Scene out = s;
  out.planes = planes;
  out.target.assign(s.pixels() * static_cast<std::size_t>(planes), 0);
  CounterRng rng(29, static_cast<std::uint64_t>(planes));
  for (std::size_t i = 0; i < s.pixels(); ++i) {
    for (std::size_t c = 0; c < 4; ++c) {
      const double fine = c < 3 ? (rng.uniform() - 0.5) / 300.0 : 0.0;
      const double value = std::clamp(photo_channel(s, i, c) + fine, 0.0, 1.0);
      if (planes == 2) {
        out.target[c / 2 * s.pixels() + i] |= static_cast<std::uint32_t>(std::lround(value * 65535))
                                              << (16 * (c % 2));
      } else {
        out.target[c * s.pixels() + i] = std::bit_cast<std::uint32_t>(static_cast<float>(value));
      }
    }
  }
  return out;
}

// What a work-item takes: a vector's pixels of whole tiles, or one pixel of a group.
constexpr int kForms[] = {0, ImageLoss::kGroups};
constexpr std::pair<PixelLoss, int> kLossForms[] = {{PixelLoss::kL1, 0},
                                                    {PixelLoss::kL2, 0},
                                                    {PixelLoss::kL1, ImageLoss::kGroups},
                                                    {PixelLoss::kL2, ImageLoss::kGroups}};

struct Reference {
  double total, pixel, ssim, psnr;
};

Reference reference_loss(const Scene& s,
                         const std::vector<double>& image,
                         PixelLoss pixel_loss,
                         double weight) {
  Reference out{};
  double square = 0, weights = 0;
  for (std::size_t c = 0; c < 3; ++c) {
    std::vector<double> x(s.pixels()), y(s.pixels());
    for (std::size_t i = 0; i < s.pixels(); ++i) {
      const double m = photo_weight(s, i);
      const double value = image[c * s.pixels() + i];
      y[i] = photo_value(s, i, c);
      x[i] = y[i] + m * (value - y[i]);
      const double d = value - y[i];
      out.pixel += m * (pixel_loss == PixelLoss::kL2 ? d * d : std::abs(d));
      const double shown = std::clamp(value, 0.0, 1.0) - y[i];
      square += m * shown * shown;
      weights += m;
    }
    out.ssim += reference::ssim(x, y, s.width, s.height).mean / 3;
  }
  const double samples = 3.0 * static_cast<double>(s.pixels());
  out.pixel /= samples;
  out.total = (1 - weight) * out.pixel + weight * (1 - out.ssim);
  out.psnr = 10 * std::log10(weights / square);
  return out;
}

// The term of coverage, without its weight.
double reference_coverage(const Scene& s, const std::vector<double>& image, PixelLoss pixel_loss) {
  double sum = 0;
  for (std::size_t i = 0; i < s.pixels(); ++i) {
    const double d = image[3 * s.pixels() + i] - photo_channel(s, i, 3);
    sum += photo_weight(s, i) * (pixel_loss == PixelLoss::kL2 ? d * d : std::abs(d));
  }
  return sum / static_cast<double>(s.pixels());
}

constexpr float kAlphaWeight = 0.3f;

struct Result {
  ImageLoss::Value value;
  std::vector<float> gradient;
};

Result run(const Scene& s, ImageLoss& loss) {
  Buffer<float> image(context(), s.image.size(), "image");
  Buffer<std::uint32_t> target(context(), s.target.size(), "target");
  // More than is needed, filled with a value that must be overwritten exactly where the gradient
  // lies.
  Buffer<float> gradient(context(), s.image.size() + 64, "gradient");
  image.upload(s.image);
  target.upload(s.target);
  gradient.upload(std::vector<float>(s.image.size() + 64, 7.0f));
  loss.evaluate(image, {target, s.planes, s.weighted}, s.alpha_is_background, s.background, s.width,
                s.height, gradient);
  Result result{loss.value(), std::vector<float>(s.image.size() + 64)};
  gradient.download(std::span<float>(result.gradient));
  for (std::size_t i = s.image.size(); i < result.gradient.size(); ++i)
    CHECK(result.gradient[i] == 7.0f);
  result.gradient.resize(s.image.size());
  return result;
}

Result run(const Scene& s, PixelLoss pixel_loss, float weight, int vector) {
  ImageLoss loss(context(), pixel_loss, {weight, kAlphaWeight}, vector);
  return run(s, loss);
}

void check_value(const Scene& s,
                 PixelLoss pixel_loss,
                 float weight,
                 const ImageLoss::Value& value) {
  const Reference expected = reference_loss(s, std::vector<double>(s.image.begin(), s.image.end()),
                                            pixel_loss, static_cast<double>(weight));
  CHECK(value.pixel == doctest::Approx(expected.pixel).epsilon(2e-6));
  CHECK(value.ssim == doctest::Approx(expected.ssim).epsilon(5e-6));
  CHECK(value.total == doctest::Approx(expected.total).epsilon(1e-5));
  CHECK(value.psnr == doctest::Approx(expected.psnr).epsilon(1e-5));
}

// Central differences of the double reference at some elements.
void check_gradient(const Scene& s,
                    PixelLoss pixel_loss,
                    float weight,
                    const std::vector<float>& gradient) {
  std::vector<double> image(s.image.begin(), s.image.end());
  const double scale = 1.0 / (3.0 * static_cast<double>(s.pixels()));
  const std::size_t step = std::max<std::size_t>(1, 3 * s.pixels() / 23);
  for (std::size_t i = 0; i < 3 * s.pixels(); i += step) {
    const double h = 1e-6;
    const double center = image[i];
    image[i] = center + h;
    const double above = reference_loss(s, image, pixel_loss, static_cast<double>(weight)).total;
    image[i] = center - h;
    const double below = reference_loss(s, image, pixel_loss, static_cast<double>(weight)).total;
    image[i] = center;
    const double expected = (above - below) / (2 * h);
    CAPTURE(i);
    CHECK(std::abs(static_cast<double>(gradient[i]) - expected) <
          2e-4 * std::abs(expected) + 2e-4 * scale);
  }
  for (std::size_t i = 3 * s.pixels(); i < 4 * s.pixels(); ++i) {
    if (!s.alpha_is_background) {
      CHECK(gradient[i] == 0.0f);
      continue;
    }
    const double h = 1e-6;
    const double center = image[i];
    image[i] = center + h;
    const double above = reference_coverage(s, image, pixel_loss);
    image[i] = center - h;
    const double below = reference_coverage(s, image, pixel_loss);
    image[i] = center;
    const double expected = static_cast<double>(kAlphaWeight) * (above - below) / (2 * h);
    CAPTURE(i);
    CHECK(std::abs(static_cast<double>(gradient[i]) - expected) <
          2e-4 * std::abs(expected) + 2e-4 * scale);
  }
}

}  // namespace

TEST_CASE("image loss: value and gradient agree with the definition in double precision") {
  struct Size {
    int width, height;
  };
  for (const Size size : {Size{1, 1}, Size{1, 23}, Size{40, 1}, Size{3, 2}, Size{7, 5}, Size{17, 9},
                          Size{16, 11}, Size{16, 16}, Size{33, 19}, Size{31, 33}}) {
    const Scene s = make_scene(size.width, size.height, 3, false);
    for (const PixelLoss pixel_loss : {PixelLoss::kL1, PixelLoss::kL2}) {
      for (const float weight : {0.0f, 0.2f, 1.0f}) {
        for (const int form : kForms) {
          CAPTURE(size.width);
          CAPTURE(size.height);
          CAPTURE(weight);
          CAPTURE(form);
          const Result result = run(s, pixel_loss, weight, form);
          check_value(s, pixel_loss, weight, result.value);
          check_gradient(s, pixel_loss, weight, result.gradient);
        }
      }
    }
  }
}

TEST_CASE(
    "image loss: masks weigh pixels, alpha over a background composites the photo [small] [tiny]") {
  for (const bool alpha_is_background : {false, true}) {
    for (const auto& [pixel_loss, form] : kLossForms) {
      CAPTURE(form);
      CAPTURE(alpha_is_background);
      Scene s = make_scene(21, 14, 5, true);
      s.alpha_is_background = alpha_is_background;
      s.background = {1.0f, 0.5f, 0.25f};
      const Result result = run(s, pixel_loss, 0.2f, form);
      check_value(s, pixel_loss, 0.2f, result.value);
      check_gradient(s, pixel_loss, 0.2f, result.gradient);
      if (alpha_is_background) continue;
      for (std::size_t i = 0; i < s.pixels(); ++i) {
        if (s.target[i] >> 24 != 0) continue;
        for (std::size_t c = 0; c < 3; ++c) CHECK(result.gradient[c * s.pixels() + i] == 0.0f);
      }
    }
  }
}

TEST_CASE("image loss: a plane of weights ignores pixels of cut-out photos [small]") {
  for (const int width : {21, 32}) {
    CAPTURE(width);
    for (const auto& [pixel_loss, form] : kLossForms) {
      CAPTURE(form);
      Scene s = make_scene(width, 14, 6, true);
      s.alpha_is_background = true;
      s.background = {1.0f, 0.5f, 0.25f};
      for (std::size_t i = 0; i < s.pixels(); ++i)
        s.target.push_back(i % 5 == 0 ? 0U : i % 5 == 1 ? 97U : 255U);
      s.weighted = true;
      const Result result = run(s, pixel_loss, 0.2f, form);
      check_value(s, pixel_loss, 0.2f, result.value);
      check_gradient(s, pixel_loss, 0.2f, result.gradient);
      for (std::size_t i = 0; i < s.pixels(); i += 5) {
        for (std::size_t c = 0; c < 3; ++c) CHECK(result.gradient[c * s.pixels() + i] == 0.0f);
      }
    }
  }
}

TEST_CASE("image loss: photos of 16 bits and of floats keep their precision [small]") {
  for (const auto& [planes, form] :
       {std::pair{2, 0}, {4, 0}, {2, ImageLoss::kGroups}, {4, ImageLoss::kGroups}}) {
    for (const bool alpha_is_background : {false, true}) {
      for (const bool weighted : {false, true}) {
        CAPTURE(planes);
        CAPTURE(alpha_is_background);
        CAPTURE(weighted);
        Scene coarse = make_scene(37, 14, 9, true);
        coarse.alpha_is_background = alpha_is_background;
        coarse.background = {1.0f, 0.5f, 0.25f};
        Scene s = with_planes(coarse, planes);
        s.weighted = weighted;
        for (std::size_t i = 0; weighted && i < s.pixels(); ++i) {
          const std::uint32_t word = i % 3 == 0 ? 0U : i % 3 == 1 ? 97U : 255U;
          const float share = static_cast<float>(word) / 255.0f;
          s.target.push_back(planes == 4 ? std::bit_cast<std::uint32_t>(share) : word);
        }
        if (weighted && !alpha_is_background) continue;  // weights are of cut-out photos
        const Result result = run(s, PixelLoss::kL2, 0.2f, form);
        check_value(s, PixelLoss::kL2, 0.2f, result.value);
        check_gradient(s, PixelLoss::kL2, 0.2f, result.gradient);
        const double rounded =
            reference_loss(coarse, std::vector<double>(s.image.begin(), s.image.end()),
                           PixelLoss::kL2, 0.2)
                .pixel;
        if (!weighted) CHECK(std::abs(result.value.pixel - rounded) > 3e-6 * rounded);
      }
    }
  }
}

TEST_CASE("image loss: what lies under a mask changes nothing") {
  Scene s = make_scene(40, 23, 11, true);
  const Result before = run(s, PixelLoss::kL1, 0.2f, 0);
  for (std::size_t i = 0; i < s.pixels(); ++i) {
    if (s.target[i] >> 24 != 0) continue;
    for (std::size_t c = 0; c < 3; ++c)
      s.image[c * s.pixels() + i] = 0.1f + 0.4f * static_cast<float>(c);
  }
  const Result after = run(s, PixelLoss::kL1, 0.2f, 0);
  CHECK(after.value.total == doctest::Approx(before.value.total).epsilon(1e-6));
  for (std::size_t i = 0; i < before.gradient.size(); ++i) {
    CHECK(after.gradient[i] == doctest::Approx(before.gradient[i]).epsilon(1e-4));
  }
}

TEST_CASE("image loss: every vector width and groups give the same result") {
  Scene s = make_scene(150, 37, 7, true);
  s.alpha_is_background = true;
  const Result narrow = run(s, PixelLoss::kL1, 0.2f, 1);
  for (const int vector : {4, 8, 16, ImageLoss::kGroups}) {
    CAPTURE(vector);
    const Result wide = run(s, PixelLoss::kL1, 0.2f, vector);
    CHECK(wide.value.total == doctest::Approx(narrow.value.total).epsilon(1e-6));
    CHECK(wide.value.psnr == doctest::Approx(narrow.value.psnr).epsilon(1e-6));
    double largest = 0, worst = 0;
    for (std::size_t i = 0; i < narrow.gradient.size(); ++i) {
      largest = std::max(largest, std::abs(static_cast<double>(narrow.gradient[i])));
      worst = std::max(worst, std::abs(static_cast<double>(wide.gradient[i]) -
                                       static_cast<double>(narrow.gradient[i])));
    }
    CHECK(worst < 1e-4 * largest);
  }
}

TEST_CASE("image loss: finite differences through value()") {
  Scene s = make_scene(20, 13, 13, true);
  ImageLoss loss(context(), PixelLoss::kL2, {0.5f});
  const std::vector<float> gradient = run(s, loss).gradient;
  for (std::size_t i = 4; i < 3 * s.pixels(); i += 97) {
    const float center = s.image[i];
    const float h = 4e-3f;
    s.image[i] = center + h;
    const double above = run(s, loss).value.total;
    const double upper = static_cast<double>(s.image[i]);
    s.image[i] = center - h;
    const double below = run(s, loss).value.total;
    const double slope = (above - below) / (upper - static_cast<double>(s.image[i]));
    s.image[i] = center;
    CHECK(static_cast<double>(gradient[i]) ==
          doctest::Approx(slope).epsilon(0.02).scale(1.0 / 780));
  }
}

TEST_CASE("image loss: one object serves images of changing size, and repeats to the bit") {
  const Scene large = make_scene(61, 45, 17, true);
  const Scene small = make_scene(9, 30, 19, false);
  for (const int form : kForms) {
    CAPTURE(form);
    ImageLoss loss(context(), PixelLoss::kL1, {0.2f, kAlphaWeight}, form);
    const Result first = run(large, loss);
    const Result second = run(small, loss);
    const Result third = run(large, loss);
    check_value(large, PixelLoss::kL1, 0.2f, first.value);
    check_value(small, PixelLoss::kL1, 0.2f, second.value);
    CHECK(first.value.total == third.value.total);
    CHECK(first.gradient == third.gradient);
  }
}

TEST_CASE("image loss: after an allocation that failed the next image of that size is right") {
  const Scene former = make_scene(9, 7, 3, true), next = make_scene(40, 33, 4, true);
  for (const int form : kForms) {
    CAPTURE(form);
    const Result expected = run(next, PixelLoss::kL1, 0.2f, form);
    bool failed = true;
    for (std::size_t n = 1; failed; ++n) {
      CAPTURE(n);
      ImageLoss loss(context(), PixelLoss::kL1, {0.2f, kAlphaWeight}, form);
      run(former, loss);
      failed = fails_at(context(), n, [&] { run(next, loss); });
      const Result result = run(next, loss);
      CHECK(result.value.total == expected.value.total);
      CHECK(result.gradient == expected.gradient);
    }
  }
}

TEST_CASE("image loss: equal images have no loss, and bad arguments are refused") {
  Scene s = make_scene(12, 12, 23, false);
  for (std::size_t i = 0; i < s.pixels(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      s.image[c * s.pixels() + i] =
          static_cast<float>((s.target[i] >> (8 * c)) & 255u) * (1.0f / 255.0f);
    }
  }
  const Result result = run(s, PixelLoss::kL1, 0.2f, 0);
  CHECK(result.value.total == doctest::Approx(0).epsilon(1e-7));
  CHECK(std::isinf(result.value.psnr));
  for (const float g : result.gradient) CHECK(std::abs(g) < 1e-7f);

  CHECK_THROWS_AS(ImageLoss(context(), PixelLoss::kL1, {1.5f}), UsageError);
  CHECK_THROWS_AS(ImageLoss(context(), PixelLoss::kL1, {0.2f}, 3), UsageError);
  ImageLoss loss(context(), PixelLoss::kL1, {0.2f});
  CHECK_THROWS_AS(loss.value(), UsageError);
  Buffer<float> image(context(), 16, "image"), gradient;
  Buffer<std::uint32_t> target(context(), 4, "target");
  CHECK_THROWS_AS(loss.evaluate(image, {target}, false, {0, 0, 0}, 3, 3, gradient), UsageError);
}

}  // namespace raysplats
