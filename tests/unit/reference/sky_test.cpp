// SPDX-License-Identifier: Apache-2.0
#include "reference/sky.hpp"

#include <doctest/doctest.h>

#include <glm/geometric.hpp>

#include "util/rng.hpp"

using namespace raysplats;
using namespace raysplats::reference;

TEST_CASE("a sky's colours and gradients equal finite differences, cut off at 0 or not") {
  CounterRng rng(4, 12);
  for (int degree = 0; degree <= 4; ++degree) {
    CAPTURE(degree);
    TraceOptions options;
    options.sky.resize(static_cast<std::size_t>((degree + 1) * (degree + 1)));
    for (auto& coefficient : options.sky) {
      for (float& value : coefficient) value = static_cast<float>(rng.normal());
    }
    std::size_t cut = 0;
    for (int i = 0; i < 40; ++i) {
      const glm::dvec3 direction(rng.normal(), rng.normal(), rng.normal());
      const glm::dvec3 slope(rng.normal(), rng.normal(), rng.normal());
      const auto loss = [&](const TraceOptions& at, const glm::dvec3& along) {
        return glm::dot(slope, light_behind(at, along));
      };
      const glm::dvec3 color = light_behind(options, direction);
      bool near_the_end = false;
      for (int k = 0; k < 3; ++k) {
        cut += color[k] == 0.0 ? 1 : 0;
        near_the_end = near_the_end || (color[k] > 0.0 && color[k] < 0.1);
      }
      if (near_the_end) continue;
      constexpr double kStep = 1e-6;
      const glm::dvec3 by_direction = light_behind_gradient(options, direction, slope);
      for (int k = 0; k < 3; ++k) {
        glm::dvec3 step(0.0);
        step[k] = kStep;
        const double numeric =
            (loss(options, direction + step) - loss(options, direction - step)) / (2 * kStep);
        CHECK(by_direction[k] == doctest::Approx(numeric).epsilon(1e-6).scale(10));
      }
      // Linear in the coefficients, which are floats: any step will do.
      const std::vector<double> by_sky = sky_gradient(options, direction, slope);
      for (std::size_t k = 0; k < by_sky.size(); ++k) {
        TraceOptions other = options;
        float& value = other.sky[k / 3][k % 3];
        const float before = value;
        value += 0.03125f;
        const double step = static_cast<double>(value) - static_cast<double>(before);
        const glm::dvec3 moved = light_behind(other, direction);
        const int channel = static_cast<int>(k % 3);
        if (color[channel] > 0.0 && moved[channel] <= 0.0) continue;
        if (color[channel] == 0.0 && moved[channel] > 0.0) continue;
        CHECK(by_sky[k] ==
              doctest::Approx((loss(other, direction) - loss(options, direction)) / step)
                  .epsilon(1e-6)
                  .scale(10));
      }
    }
    CHECK((degree == 0 || cut > 0));
  }
}
