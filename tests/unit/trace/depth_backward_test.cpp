// SPDX-License-Identifier: Apache-2.0
// The gradient of depth against finite differences of the double-precision reference.
#include <doctest/doctest.h>

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

#include "scene/camera/camera_model.hpp"
#include "unit/trace/trace_fixture.hpp"

using namespace raysplats;

namespace {

constexpr double kStep = 1e-6;

// The double reference of any camera; depths lie along the rays of those that are no pinholes.
reference::Render render_of(const reference::Parameters& parameters,
                            const TraceOptions& options,
                            const Camera& camera) {
  if (camera.model == CameraModel::kPinhole) return reference::render(parameters, options, camera);
  reference::Render out;
  out.width = camera.width;
  out.height = camera.height;
  const std::size_t pixels = out.pixels();
  out.image.resize(4 * pixels);
  out.depth.resize(3 * pixels);
  out.margin.resize(pixels);
  for (std::size_t i = 0; i < pixels; ++i) {
    const auto column = static_cast<double>(i % static_cast<std::size_t>(camera.width));
    const auto row = static_cast<double>(i / static_cast<std::size_t>(camera.width));
    const CameraRay ray = camera_ray(camera, column + 0.5, row + 0.5);
    REQUIRE(ray.valid);
    const reference::RayTrace trace =
        reference::trace_ray(parameters, options, ray.origin, ray.direction, 0.0, 1e30,
                             reference::ColorMode::kFromOrigin);
    for (std::size_t c = 0; c < 3; ++c)
      out.image[c * pixels + i] = trace.color[static_cast<int>(c)];
    out.image[3 * pixels + i] = trace.alpha;
    out.depth[i] = trace.expected_depth;
    out.margin[i] = trace.margin;
  }
  return out;
}

// A loss of picture and depth: sum g c + sum h (expected depth), of the pixels whose hits no small
// step changes.
struct Loss {
  std::vector<float> image;  // planar R, G, B, A
  std::vector<float> depth;

  Loss(const reference::Render& render, std::uint64_t seed)
      : image(random_image_gradient(render.pixels(), seed)),
        depth(random_image_gradient(render.pixels(), seed + 1)) {
    depth.resize(render.pixels());
    for (std::size_t i = 0; i < render.pixels(); ++i) {
      // Nothing is divided by a coverage of nearly 0.
      const bool counts = render.margin[i] >= 1e-4 && render.image[3 * render.pixels() + i] > 0.05;
      for (std::size_t c = 0; c < 4; ++c) image[c * render.pixels() + i] *= counts ? 1.0f : 0.0f;
      depth[i] *= counts ? 3.0f : 0.0f;
    }
  }

  double of(const reference::Render& render) const {
    double sum = 0;
    for (std::size_t i = 0; i < image.size(); ++i)
      sum += static_cast<double>(image[i]) * render.image[i];
    for (std::size_t i = 0; i < depth.size(); ++i)
      sum += static_cast<double>(depth[i]) * render.depth[i];
    return sum;
  }
};

// Central differences of the loss for every number of a group.
std::vector<double> differences(const reference::Parameters& parameters,
                                std::vector<double> reference::Parameters::*group,
                                const TraceOptions& options,
                                const Camera& camera,
                                const Loss& loss) {
  std::vector<double> out((parameters.*group).size());
  for (std::size_t k = 0; k < out.size(); ++k) {
    std::array<double, 2> sides{};
    for (int side = 0; side < 2; ++side) {
      reference::Parameters moved = parameters;
      (moved.*group)[k] += side == 0 ? kStep : -kStep;
      sides[static_cast<std::size_t>(side)] = loss.of(render_of(moved, options, camera));
    }
    out[k] = (sides[0] - sides[1]) / (2 * kStep);
  }
  return out;
}

HostGradients on_device(Context& context,
                        const Gaussians& model,
                        const TraceOptions& options,
                        const Camera& camera,
                        const Loss& loss) {
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  CameraTracer tracer(context, options);
  tracer.update(gaussians);
  tracer.forward(gaussians, camera, true);
  const std::size_t pixels = loss.depth.size();
  const std::vector<float> image = tracer.image().download(), depth = tracer.depth().download();
  // Expected depth is S / A.
  std::vector<float> of_image = loss.image, of_sum(pixels);
  for (std::size_t i = 0; i < pixels; ++i) {
    if (loss.depth[i] == 0.0f) continue;
    of_sum[i] = loss.depth[i] / image[3 * pixels + i];
    of_image[3 * pixels + i] -= of_sum[i] * depth[i];
  }
  Buffer<float> image_gradient(context, of_image.size(), "image gradient");
  image_gradient.upload(of_image);
  Buffer<float> depth_gradient(context, pixels, "depth gradient");
  depth_gradient.upload(of_sum);
  GaussianGradients out;
  tracer.backward(gaussians, image_gradient, out, nullptr, &depth_gradient);
  return HostGradients(out);
}

void check_against_differences(const Gaussians& model, TraceOptions options, const Camera& camera) {
  Context context = make_test_context();
  options.depth = true;
  const reference::Parameters parameters(model, ScaleActivation::kExp);
  const Loss loss(render_of(parameters, options, camera), 31);
  REQUIRE(std::count_if(loss.depth.begin(), loss.depth.end(), [](float g) { return g != 0; }) > 3);
  const HostGradients got = on_device(context, model, options, camera, loss);
  const auto check = [&](const char* name, const std::vector<float>& numbers,
                         std::vector<double> reference::Parameters::*group) {
    CAPTURE(name);
    CHECK(relative_error(numbers, differences(parameters, group, options, camera, loss)) < 2e-3);
  };
  check("means", got.means, &reference::Parameters::means);
  check("quaternions", got.quaternions, &reference::Parameters::quaternions);
  check("scales", got.scales, &reference::Parameters::scales);
  check("opacities", got.opacities, &reference::Parameters::opacities);
  check("sh", got.sh, &reference::Parameters::sh);
}

}  // namespace

TEST_CASE("the gradient of depth equals finite differences for packets and groups [small]") {
  for (const HitOrder order : {HitOrder::kEntry, HitOrder::kPeak}) {
    for (const PacketShape shape : {PacketShape::kVector, PacketShape::kGroup}) {
      CAPTURE(static_cast<int>(order));
      CAPTURE(static_cast<int>(shape));
      TraceOptions options;
      options.hit_order = order;
      options.packet_shape = shape;
      options.background = {0.25f, 0.5f, 1.0f};
      check_against_differences(reference::random_scene(20, 21, 1), options,
                                reference::cube_camera(7, 6));
    }
  }
}

TEST_CASE(
    "the gradient of depth of packets with more rows open than a group's first launch keeps") {
  TraceOptions options;
  options.packet_shape = PacketShape::kGroup;
  options.min_transmittance = 1e-6f;
  check_against_differences(crowded_scene(50), options, reference::cube_camera(16, 14));
}

TEST_CASE("the gradient of depth holds for Gaussians beside and behind the camera plane") {
  const Camera camera = look_at({0.1, -0.2, 0.15}, {1, 0.3, 0.5}, {0, 1, 0}, 9, 8, 7);
  check_against_differences(reference::random_scene(60, 24, 0), {}, camera);
}

TEST_CASE("the gradient of depth along the rays of a fisheye equals finite differences") {
  Camera camera = look_at({0, 0, -3}, {0, 0, 0}, {0, 1, 0}, 9, 9, 5);
  camera.model = CameraModel::kFisheye;
  check_against_differences(reference::random_scene(20, 21, 0), {}, camera);
}

TEST_CASE(
    "the gradient of depth through a view's footprint, from within the Gaussians too [small]") {
  TraceOptions options;
  options.hit_order = HitOrder::kPeak;
  options.view_footprint = 0.5f;
  Gaussians model = reference::random_scene(30, 21, 1);
  for (std::size_t i = 0; i < model.log_scales.size(); i += 2) model.log_scales[i] -= 2.5f;
  check_against_differences(model, options, reference::cube_camera(7, 6));
  const Camera within = look_at({0.1, -0.2, 0.15}, {1, 0.3, 0.5}, {0, 1, 0}, 9, 8, 7);
  check_against_differences(model, options, within);
}
