// SPDX-License-Identifier: Apache-2.0
// Gaussians far longer than thick: a line of the view keeps the digits of their thin axes.
#include <doctest/doctest.h>

#include <cmath>
#include <cstddef>
#include <vector>

#include "unit/trace/trace_fixture.hpp"

using namespace raysplats;

namespace {

// 400 needles in all directions, each seen in its whole length.
Gaussians needles(float thickness, float ratio, float opacity) {
  Gaussians model = reference::random_scene(400, 51, 0);
  for (std::size_t i = 0; i < model.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k)
      model.log_scales[3 * i + k] = std::log(k == i % 3 ? thickness * ratio : thickness);
    model.opacities[i] = opacity;
  }
  return model;
}

struct Result {
  std::vector<float> image;
  HostGradients gradients;
};

Result trace(Context& context,
             const Gaussians& model,
             const TraceOptions& options,
             const Camera& camera,
             const std::vector<float>& image_gradient) {
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  CameraTracer tracer(context, options);
  tracer.update(gaussians);
  tracer.forward(gaussians, camera, true);
  return {tracer.image().download(), backward(context, tracer, gaussians, image_gradient)};
}

// Mean difference of alpha over the pixels that see anything.
double alpha_error(const std::vector<float>& image, const reference::Render& expected) {
  const std::size_t plane = 3 * expected.pixels();
  double sum = 0;
  std::size_t seen = 0;
  for (std::size_t i = plane; i < image.size(); ++i) {
    if (expected.image[i] == 0 && image[i] == 0.0f) continue;
    sum += std::abs(static_cast<double>(image[i]) - expected.image[i]);
    ++seen;
  }
  REQUIRE(seen > 2500);
  return sum / static_cast<double>(seen);
}

}  // namespace

TEST_CASE("needles of 1:1000 and their gradients equal the double reference") {
  Context context = make_test_context();
  const Gaussians model = needles(3e-4f, 1000.0f, 1.0f);
  const Camera camera = reference::cube_camera(160, 120);
  const reference::Parameters parameters(model);
  const reference::Render render = reference::render(parameters, {}, camera);
  std::vector<float> image_gradient = random_image_gradient(render.pixels(), 52);
  for (std::size_t i = 0; i < image_gradient.size(); ++i) {
    // No hit may be decided otherwise by rounding.
    if (render.margin[i % render.pixels()] < 1e-2) image_gradient[i] = 0.0f;
  }
  const reference::Gradient expected = reference::render_gradient(
      parameters, {}, camera, std::vector<double>(image_gradient.begin(), image_gradient.end()));
  for (const Packet& packet : packets({1, 16}, {32})) {
    CAPTURE(packet);
    const Result got = trace(context, model, packet.over({}), camera, image_gradient);
    CHECK(alpha_error(got.image, render) < 3e-5);
    CHECK(relative_error(got.gradients.means, expected.parameters.means) < 1e-3);
    CHECK(relative_error(got.gradients.quaternions, expected.parameters.quaternions) < 1e-3);
    CHECK(relative_error(got.gradients.scales, expected.parameters.scales) < 1e-3);
    CHECK(relative_error(got.gradients.opacities, expected.parameters.opacities) < 1e-3);
  }
}

TEST_CASE("needles of 1:10000 are never more than opaque") {
  Context context = make_test_context();
  const Gaussians model = needles(5e-5f, 10000.0f, 12.0f);
  for (const Packet& packet : packets({1, 16}, {32})) {
    CAPTURE(packet);
    const Image image =
        trace_image(context, model, packet.over({}), reference::cube_camera(160, 120));
    std::size_t outside = 0;
    for (std::size_t i = 3; i < image.data.size(); i += 4)
      outside += image.data[i] >= 0.0f && image.data[i] <= 1.0f ? 0 : 1;
    CHECK(outside == 0);
  }
}
