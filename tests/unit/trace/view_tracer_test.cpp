// SPDX-License-Identifier: Apache-2.0
#include "trace/view_tracer.hpp"

#include <doctest/doctest.h>

#include <glm/geometric.hpp>

#include "core/camera_model.hpp"
#include "trace_fixture.hpp"

using namespace raysplats;

namespace {

Camera view_of(CameraModel model, int width, int height, double focal) {
  Camera camera = look_at({0.4, -0.3, -2.6}, {0, 0, 0}, {0, -1, 0}, width, height, focal);
  camera.model = model;
  return camera;
}

}  // namespace

TEST_CASE("a pinhole's picture ray by ray equals the one of packets, depth and all [small]") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(600, 41, 2);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  for (const HitOrder order : {HitOrder::kEntry, HitOrder::kPeak}) {
    CAPTURE(static_cast<int>(order));
    TraceOptions options;
    options.hit_order = order;
    options.background = {0.1f, 0.3f, 0.5f};
    options.depth = true;
    // So little that the rays come in several batches.
    options.memory_budget = 1 << 20;
    ViewTracer tracer(context, options);
    tracer.update(gaussians);
    const Camera camera = view_of(CameraModel::kPinhole, 120, 90, 100);
    const Image packets = tracer.render(gaussians, camera);
    const Image packet_depth = tracer.depth();
    const Image rays = tracer.render_rays(gaussians, camera);
    const Image ray_depth = tracer.depth();
    REQUIRE(rays.data.size() == packets.data.size());
    REQUIRE(ray_depth.data.size() == packet_depth.data.size());
    double mean = 0;
    std::size_t other = 0, other_depth = 0, other_hits = 0, covered = 0;
    for (std::size_t i = 0; i < packets.pixels(); ++i) {
      float worst = 0;
      for (std::size_t c = 0; c < 4; ++c) {
        const float difference = std::abs(rays.data[4 * i + c] - packets.data[4 * i + c]);
        worst = std::max(worst, difference);
        mean += static_cast<double>(difference) / static_cast<double>(packets.data.size());
      }
      other += worst > 1e-3f ? 1 : 0;
      const float a = ray_depth.data[3 * i], b = packet_depth.data[3 * i];
      other_depth += std::abs(a - b) > 1e-3f * std::max(a, b) ? 1 : 0;
      other_hits += ray_depth.data[3 * i + 2] == packet_depth.data[3 * i + 2] ? 0 : 1;
      covered += packets.data[4 * i + 3] > 0.5f ? 1 : 0;
    }
    // Single precision decides near-ties in order and at outlines either way.
    CHECK(mean < 1e-5);
    CHECK(other * 500 < packets.pixels());
    CHECK(other_depth * 500 < packets.pixels());
    CHECK(other_hits * 500 < packets.pixels());
    CHECK(covered > 1000);
  }
}

TEST_CASE("pictures of other cameras equal the double reference ray by ray [small]") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(300, 42, 2);
  const reference::Parameters parameters(model);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  TraceOptions options;
  options.background = {0.1f, 0.3f, 0.5f};
  options.depth = true;
  ViewTracer tracer(context, options);
  tracer.update(gaussians);
  Camera opencv = view_of(CameraModel::kOpenCv, 28, 21, 22);
  opencv.distortion = {-0.1, 0.02, 0, 0.002, -0.003, 0};
  Camera panorama = view_of(CameraModel::kEquirectangular, 40, 20, 1);
  panorama.translation = {0, 0, 0.2};
  for (const Camera& camera : {opencv, view_of(CameraModel::kFisheye, 30, 30, 6), panorama,
                               view_of(CameraModel::kOrthographic, 28, 21, 10)}) {
    CAPTURE(static_cast<int>(camera.model));
    const Image image = tracer.render(gaussians, camera);
    const Image depth = tracer.depth();
    const bool orthographic = camera.model == CameraModel::kOrthographic;
    const glm::dvec3 axis(camera.rotation[0][2], camera.rotation[1][2], camera.rotation[2][2]);
    std::size_t compared = 0, hit = 0, wrong = 0;
    for (std::size_t i = 0; i < image.pixels(); ++i) {
      const auto width = static_cast<std::size_t>(camera.width);
      const CameraRay ray = camera_ray(camera, static_cast<double>(i % width) + 0.5,
                                       static_cast<double>(i / width) + 0.5);
      if (!ray.valid) {
        wrong += image.data[4 * i] == 0.1f && image.data[4 * i + 3] == 0.0f ? 0 : 1;
        continue;
      }
      const reference::RayTrace expected = reference::trace_ray(
          parameters, options, ray.origin, ray.direction, 0.0, 1e30,
          orthographic ? reference::ColorMode::kAlongRay : reference::ColorMode::kFromOrigin);
      if (expected.margin < 1e-4) continue;
      ++compared;
      hit += expected.hits.empty() ? 0 : 1;
      double worst = std::abs(static_cast<double>(image.data[4 * i + 3]) - expected.alpha);
      for (int c = 0; c < 3; ++c) {
        worst = std::max(
            worst, std::abs(static_cast<double>(image.data[4 * i + static_cast<std::size_t>(c)]) -
                            expected.color[c]));
      }
      const double along =
          camera.model == CameraModel::kOpenCv ? glm::dot(axis, ray.direction) : 1.0;
      const double far = along * expected.expected_depth;
      wrong +=
          worst < 2e-3 && std::abs(static_cast<double>(depth.data[3 * i]) - far) <= 2e-3 * (1 + far)
              ? 0
              : 1;
    }
    CHECK(wrong == 0);
    CHECK(compared * 2 > image.pixels());
    CHECK(hit > 50);
  }
}

TEST_CASE("cameras that a view cannot be traced from are refused") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(20, 43, 0);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  TraceOptions options;
  ViewTracer tracer(context, options);
  tracer.update(gaussians);
  Camera camera = view_of(CameraModel::kFisheye, 8, 8, 0);
  CHECK_THROWS_AS(tracer.render(gaussians, camera), UsageError);
  camera.model = CameraModel::kEquirectangular;
  CHECK_NOTHROW(tracer.render(gaussians, camera));
  options.near_depth = 0.5f;
  ViewTracer near(context, options);
  near.update(gaussians);
  CHECK_THROWS_AS(near.render(gaussians, camera), UsageError);
  CHECK_NOTHROW(near.render(gaussians, view_of(CameraModel::kPinhole, 8, 8, 9)));
  CameraTracer packets(context, TraceOptions{});
  packets.update(gaussians);
  CHECK_THROWS_AS(packets.forward(gaussians, view_of(CameraModel::kOpenCv, 8, 8, 9)), UsageError);
}
