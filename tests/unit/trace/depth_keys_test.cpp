// SPDX-License-Identifier: Apache-2.0
// The order of the lists of tiles: it changes what a picture costs, not what it shows.
#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "trace/view_sizes.h"
#include "unit/trace/trace_fixture.hpp"

using namespace raysplats;

namespace {

struct Cost {
  std::uint64_t tested = 0;  // candidates against the rays of a packet
  Image image;
};

// What a view of the model costs in a world that is 2^power times as large.
Cost cost_of(Context& context, const Gaussians& model, int power) {
  Gaussians scaled = model;
  for (float& mean : scaled.means) mean = std::ldexp(mean, power);
  for (float& scale : scaled.log_scales) scale += static_cast<float>(power * std::log(2.0));
  Camera camera = reference::cube_camera(64, 48);
  camera.translation *= std::ldexp(1.0, power);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, scaled, ScaleActivation::kExp);
  CameraTracer tracer(context, {});
  tracer.count_work();
  tracer.update(gaussians);
  tracer.forward(gaussians, camera);
  return {tracer.work()[RS_TALLY_TESTED], tracer.download_image()};
}

/// Three of the Gaussians that a view of 3000 asks for their distance, and that no picture shows.
Gaussians with_outliers(Gaussians model, const std::array<float, 3>& place, float log_scale) {
  REQUIRE(model.size() == 3000);
  for (const std::size_t i : {0, 375, 750}) {
    for (std::size_t k = 0; k < 3; ++k) {
      model.means[3 * i + k] = place[k];
      model.log_scales[3 * i + k] = log_scale;
    }
  }
  return model;
}

/// Gaussians behind which rays end early where order lets them.
Gaussians opaque_scene() {
  Gaussians model = reference::random_scene(3000, 51, 0);
  for (float& opacity : model.opacities) opacity += 5.0f;
  return model;
}

double mean_difference(const Image& a, const Image& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.data.size(); ++i)
    sum += static_cast<double>(std::abs(a.data[i] - b.data[i]));
  return sum / static_cast<double>(a.data.size());
}

}  // namespace

TEST_CASE("scenes in small and in large units are put in order as well as others") {
  Context context = make_test_context();
  const Gaussians model = opaque_scene();
  const Cost unit = cost_of(context, model, 0);
  REQUIRE(unit.tested > 1000);
  for (const int power : {-20, -14, 30}) {
    CAPTURE(power);
    const Cost scaled = cost_of(context, model, power);
    CHECK(static_cast<double>(scaled.tested) ==
          doctest::Approx(static_cast<double>(unit.tested)).epsilon(0.02));
    CHECK(mean_difference(scaled.image, unit.image) < 1e-4);
  }
}

TEST_CASE("a few Gaussians that are very far or very near leave the others in order") {
  Context context = make_test_context();
  const Gaussians model = opaque_scene();
  // Behind the camera, as far away as others.
  const Cost plain = cost_of(context, with_outliers(model, {0, 0, -8}, -8), 0);
  REQUIRE(plain.tested > 1000);
  const std::vector<Gaussians> others{with_outliers(model, {-3e9f, -3e9f, -3e9f}, 0),
                                      with_outliers(model, {3e12f, -3e12f, -3e12f}, 0),
                                      with_outliers(model, {0, 0, -4.0001f}, -20)};
  for (const Gaussians& other : others) {
    CAPTURE(other.means[0]);
    const Cost cost = cost_of(context, other, 0);
    CHECK(static_cast<double>(cost.tested) ==
          doctest::Approx(static_cast<double>(plain.tested)).epsilon(0.02));
    CHECK(mean_difference(cost.image, plain.image) < 1e-4);
  }
}
