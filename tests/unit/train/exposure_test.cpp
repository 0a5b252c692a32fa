// SPDX-License-Identifier: Apache-2.0
#include "train/exposure.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "base/rng.hpp"
#include "raysplats/device.hpp"
#include "raysplats/error.hpp"

using namespace raysplats;

namespace {

constexpr int kWidth = 23;
constexpr int kHeight = 37;
constexpr std::size_t kPixels = kWidth * kHeight;
constexpr std::size_t kViews = 5;

Context& context() {
  static Context device{select_device("")};
  return device;
}

std::vector<float> noise(std::size_t count, std::uint64_t stream, double low, double high) {
  CounterRng rng(3, stream);
  std::vector<float> out(count);
  for (float& value : out) value = static_cast<float>(low + (high - low) * rng.uniform());
  return out;
}

// The same in double precision.
struct Reference {
  std::vector<double> deltas = std::vector<double>(12 * kViews);
  std::vector<double> first = deltas, second = deltas, steps = deltas;

  std::vector<double> apply(const std::vector<float>& image, std::size_t view) const {
    std::vector<double> out(image.begin(), image.end());
    for (std::size_t i = 0; i < kPixels; ++i) {
      for (std::size_t c = 0; c < 3; ++c) {
        const double* row = deltas.data() + 12 * view + 4 * c;
        double sum = row[3];
        for (std::size_t k = 0; k < 3; ++k)
          sum += row[k] * static_cast<double>(image[k * kPixels + i]);
        out[c * kPixels + i] += sum;
      }
    }
    return out;
  }

  std::vector<double> step(const std::vector<float>& image,
                           const std::vector<float>& gradient,
                           std::size_t view,
                           double rate) {
    std::vector<double> back(gradient.begin(), gradient.end());
    std::array<double, 12> sum{};
    for (std::size_t i = 0; i < kPixels; ++i) {
      for (std::size_t c = 0; c < 3; ++c) {
        const double g = static_cast<double>(gradient[c * kPixels + i]);
        for (std::size_t k = 0; k < 3; ++k) {
          sum[4 * c + k] += g * static_cast<double>(image[k * kPixels + i]);
          back[k * kPixels + i] += deltas[12 * view + 4 * c + k] * g;
        }
        sum[4 * c + 3] += g;
      }
    }
    for (std::size_t k = 0; k < 12; ++k) {
      const std::size_t at = 12 * view + k;
      steps[at] += 1;
      first[at] = 0.9 * first[at] + 0.1 * sum[k];
      second[at] = 0.999 * second[at] + 0.001 * sum[k] * sum[k];
      deltas[at] -= rate * first[at] / (1 - std::pow(0.9, steps[at])) /
                    std::sqrt(second[at] / (1 - std::pow(0.999, steps[at])));
      double mean = 0;
      for (std::size_t v = 0; v < kViews; ++v) mean += deltas[12 * v + k] / kViews;
      for (std::size_t v = 0; v < kViews; ++v) deltas[12 * v + k] -= mean;
    }
    return back;
  }
};

}  // namespace

TEST_CASE("exposure: pictures, gradients and steps agree with double precision [small]") {
  Exposure exposure(context(), kViews);
  Reference reference;
  Buffer<float> image(context(), 4 * kPixels, "image");
  Buffer<float> gradient(context(), 4 * kPixels, "gradient");
  Buffer<std::uint32_t> guard(context(), 1, "guard");
  guard.upload(std::vector<std::uint32_t>{0});
  for (std::size_t turn = 0; turn < 12; ++turn) {
    CAPTURE(turn);
    const std::size_t view = turn * 3 % kViews;
    const std::vector<float> picture = noise(4 * kPixels, 10 + turn, 0.0, 1.0);
    const std::vector<float> slope = noise(4 * kPixels, 50 + turn, -1.0, 0.6);
    image.upload(picture);
    gradient.upload(slope);
    const std::vector<double> expected = reference.apply(picture, view);
    const std::vector<float> shown = exposure.apply(image, view, kWidth, kHeight).download();
    for (std::size_t i = 0; i < 4 * kPixels; ++i)
      REQUIRE(static_cast<double>(shown[i]) == doctest::Approx(expected[i]).epsilon(1e-5));
    exposure.backward(image, gradient, view, kWidth, kHeight);
    exposure.step(view, 0, 0.05, guard);
    const std::vector<double> back = reference.step(picture, slope, view, 0.05);
    const std::vector<float> got = gradient.download();
    for (std::size_t i = 0; i < 4 * kPixels; ++i)
      REQUIRE(static_cast<double>(got[i]) == doctest::Approx(back[i]).epsilon(1e-4));
    const Exposure::State state = exposure.state();
    for (std::size_t k = 0; k < 12; ++k) {
      double sum = 0;
      for (std::size_t v = 0; v < kViews; ++v) {
        const double delta = static_cast<double>(state.deltas[12 * v + k]);
        sum += delta;
        CHECK(std::abs(delta - reference.deltas[12 * v + k]) < 2e-5);
      }
      CHECK(std::abs(sum) < 1e-6);
    }
  }
}

TEST_CASE("exposure: marked steps change nothing, and a state goes on where it was [small]") {
  Exposure exposure(context(), kViews);
  Buffer<float> image(context(), 4 * kPixels, "image");
  Buffer<float> gradient(context(), 4 * kPixels, "gradient");
  image.upload(noise(4 * kPixels, 1, 0.0, 1.0));
  const std::vector<float> slope = noise(4 * kPixels, 2, -1.0, 1.0);
  Buffer<std::uint32_t> guard(context(), 1, "guard");
  const auto step = [&](Exposure& target, std::size_t view, std::uint32_t mark) {
    guard.upload(std::vector<std::uint32_t>{mark});
    gradient.upload(slope);
    target.backward(image, gradient, view, kWidth, kHeight);
    target.step(view, 0, 0.02, guard);
  };
  step(exposure, 1, 0);
  const Exposure::State before = exposure.state();
  step(exposure, 2, 1);
  CHECK(exposure.state().deltas == before.deltas);
  CHECK(exposure.state().steps == before.steps);
  Exposure other(context(), kViews);
  other.restore(before);
  step(exposure, 3, 0);
  step(other, 3, 0);
  CHECK(exposure.state().deltas == other.state().deltas);
  CHECK(exposure.state().deltas != before.deltas);
  CHECK_THROWS_AS(Exposure(context(), kViews + 1).restore(before), DataError);
}
