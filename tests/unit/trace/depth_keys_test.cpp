// SPDX-License-Identifier: Apache-2.0
// The order of the lists of tiles: it changes what a picture costs, not what it shows.
#include <doctest/doctest.h>

#include <cmath>
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

}  // namespace

TEST_CASE("scenes in small and in large units are put in order as well as others") {
  Context context = make_test_context();
  Gaussians model = reference::random_scene(3000, 51, 0);
  for (float& opacity : model.opacities) opacity += 5.0f;  // rays end early where order lets them
  const Cost unit = cost_of(context, model, 0);
  REQUIRE(unit.tested > 1000);
  for (const int power : {-20, -14, 30}) {
    CAPTURE(power);
    const Cost scaled = cost_of(context, model, power);
    CHECK(static_cast<double>(scaled.tested) ==
          doctest::Approx(static_cast<double>(unit.tested)).epsilon(0.02));
    double mean = 0;
    for (std::size_t i = 0; i < unit.image.data.size(); ++i)
      mean += static_cast<double>(std::abs(scaled.image.data[i] - unit.image.data[i]));
    CHECK(mean < 1e-4 * static_cast<double>(unit.image.data.size()));
  }
}
