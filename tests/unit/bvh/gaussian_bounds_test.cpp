// SPDX-License-Identifier: Apache-2.0
#include "bvh/gaussian_bounds.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "raysplats/error.hpp"
#include "unit/fixture.hpp"
#include "util/rng.hpp"

using namespace raysplats;

namespace {

struct Parameters {
  std::vector<float> means, quaternions, scales, opacities;

  explicit Parameters(std::size_t count) {
    CounterRng rng(count, 6);
    for (std::size_t i = 0; i < count; ++i) {
      for (int a = 0; a < 3; ++a) means.push_back(static_cast<float>(10 * rng.normal()));
      for (int a = 0; a < 4; ++a) quaternions.push_back(static_cast<float>(3 * rng.normal()));
      for (int a = 0; a < 3; ++a) scales.push_back(static_cast<float>(-3 + 2 * rng.normal()));
      opacities.push_back(static_cast<float>(-2 + 4 * rng.normal()));
    }
  }
  std::size_t size() const { return opacities.size(); }
};

std::vector<RsAabb> device_bounds(
    Context& context, const Parameters& p, bool sigmoid, bool adaptive, float quantile) {
  const auto upload = [&](const std::vector<float>& values) {
    Buffer<float> buffer(context, values.size(), "parameters");
    buffer.upload(values);
    return buffer;
  };
  GaussianBounds bounds(context, sigmoid, adaptive);
  Buffer<RsAabb> boxes;
  bounds.compute(upload(p.means), upload(p.quaternions), upload(p.scales), upload(p.opacities),
                 p.size(), quantile, boxes);
  return boxes.download();
}

double sigmoid_of(double x) { return 1 / (1 + std::exp(-x)); }

// The half-widths by definition, from the full covariance.
struct Exact {
  double half[3];
  double room[3];  // what the box may be wider: rounding of a radius near zero, relative growth
  bool hidden;
};

Exact exact_bounds(
    const Parameters& p, std::size_t i, bool sigmoid, bool adaptive, double quantile) {
  double q[4];
  double norm = 0;
  for (std::size_t a = 0; a < 4; ++a) {
    q[a] = p.quaternions[4 * i + a];
    norm += q[a] * q[a];
  }
  for (double& c : q) c /= std::sqrt(norm);
  const auto [r, x, y, z] = q;
  const double rotation[3][3] = {
      {r * r + x * x - y * y - z * z, 2 * (x * y - r * z), 2 * (x * z + r * y)},
      {2 * (x * y + r * z), r * r - x * x + y * y - z * z, 2 * (y * z - r * x)},
      {2 * (x * z - r * y), 2 * (y * z + r * x), r * r - x * x - y * y + z * z}};
  const double alpha = sigmoid_of(p.opacities[i]);
  if (adaptive) quantile = std::min(quantile, 2 * std::log(255 * alpha));
  Exact exact{};
  exact.hidden = adaptive && alpha < 1.0 / 255;
  for (int j = 0; j < 3; ++j) {
    double variance = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      const double s = p.scales[3 * i + k];
      const double deviation = rotation[j][k] * (sigmoid ? sigmoid_of(s) : std::exp(s));
      variance += deviation * deviation;
    }
    exact.half[j] = std::sqrt(std::max(quantile, 0.0) * variance);
    exact.room[j] = std::sqrt((std::max(quantile, 0.0) + 2e-5) * variance) * 1.0001 - exact.half[j];
  }
  return exact;
}

bool is_empty(const RsAabb& box) {
  return box.lo[0] > box.hi[0] && box.lo[1] > box.hi[1] && box.lo[2] > box.hi[2];
}

}  // namespace

TEST_CASE("gaussian bounds: contain the ellipsoid and are tight") {
  Context context(test_device());
  const Parameters p(2001);
  for (const bool sigmoid : {false, true}) {
    for (const bool adaptive : {false, true}) {
      CAPTURE(sigmoid);
      CAPTURE(adaptive);
      const float quantile = 11.3449f;
      const std::vector<RsAabb> boxes = device_bounds(context, p, sigmoid, adaptive, quantile);
      std::size_t hidden = 0;
      std::size_t wrong = 0;
      for (std::size_t i = 0; i < p.size(); ++i) {
        const Exact exact = exact_bounds(p, i, sigmoid, adaptive, quantile);
        if (exact.hidden) {
          ++hidden;
          wrong += !is_empty(boxes[i]);
          continue;
        }
        for (int j = 0; j < 3; ++j) {
          const double mean = p.means[3 * i + static_cast<std::size_t>(j)];
          const double slack = exact.room[j] + 1e-6 * std::abs(mean);
          const double below = mean - exact.half[j] - boxes[i].lo[j];
          const double above = boxes[i].hi[j] - (mean + exact.half[j]);
          wrong += !(below >= 0 && below <= slack && above >= 0 && above <= slack);
        }
      }
      CHECK(wrong == 0);
      CHECK((hidden > 0) == adaptive);
    }
  }
}

TEST_CASE("gaussian bounds: values that are not finite give empty boxes [small] [tiny]") {
  Context context(test_device());
  const float nan = std::numeric_limits<float>::quiet_NaN();
  const float infinity = std::numeric_limits<float>::infinity();
  Parameters p(16);
  p.means[3 * 0 + 1] = nan;
  p.means[3 * 1 + 2] = infinity;
  p.quaternions[4 * 2 + 3] = nan;
  p.quaternions[4 * 3 + 0] = infinity;
  std::fill_n(p.quaternions.begin() + 4 * 4, 4, 0.0f);
  p.scales[3 * 5 + 0] = nan;
  p.scales[3 * 6 + 1] = 100.0f;  // exp overflows
  p.opacities[7] = nan;
  p.opacities[8] = infinity;
  const std::vector<RsAabb> boxes = device_bounds(context, p, false, false, 4.0f);
  for (std::size_t i = 0; i < 9; ++i) {
    CAPTURE(i);
    CHECK(is_empty(boxes[i]));
  }
  for (std::size_t i = 9; i < p.size(); ++i) CHECK_FALSE(is_empty(boxes[i]));
}

TEST_CASE("gaussian bounds: extreme lengths of quaternions and scales [small] [tiny]") {
  Context context(test_device());
  Parameters p(4);
  for (std::size_t a = 0; a < 4; ++a) {
    p.quaternions[4 * 0 + a] *= 1e-30f;
    p.quaternions[4 * 1 + a] *= 1e30f;
  }
  for (std::size_t a = 0; a < 3; ++a) {
    p.scales[3 * 2 + a] = -55.0f;  // its square is no float
    p.scales[3 * 3 + a] = 50.0f;
  }
  std::fill(p.means.begin(), p.means.end(), 0.0f);
  const std::vector<RsAabb> boxes = device_bounds(context, p, false, false, 9.0f);
  for (std::size_t i = 0; i < p.size(); ++i) {
    CAPTURE(i);
    const Exact exact = exact_bounds(p, i, false, false, 9.0);
    for (int j = 0; j < 3; ++j) {
      CHECK(boxes[i].hi[j] >= exact.half[j]);
      CHECK(boxes[i].hi[j] <= exact.half[j] * 1.0001);
      CHECK(boxes[i].lo[j] == -boxes[i].hi[j]);
    }
  }
}

TEST_CASE("gaussian bounds: buffers that are too short are refused") {
  Context context(test_device());
  GaussianBounds bounds(context, false, false);
  Buffer<float> three(context, 3, "three");
  Buffer<float> four(context, 4, "four");
  Buffer<RsAabb> boxes;
  CHECK_NOTHROW(bounds.compute(three, four, three, four, 0, 4.0f, boxes));
  CHECK_NOTHROW(bounds.compute(three, four, three, four, 1, 4.0f, boxes));
  CHECK_THROWS_AS(bounds.compute(three, four, three, four, 2, 4.0f, boxes), UsageError);
}
