// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>

#include "scene/camera/camera_model.hpp"
#include "unit/light/view_fixture.hpp"

using namespace raysplats;

namespace {

void check_lens(Context& context, const Gaussians& model, CameraModel lens, int width, int height) {
  TraceOptions options;
  options.hit_order = HitOrder::kPeak;
  options.background = {0.3f, 0.2f, 0.1f};
  const reference::Parameters parameters(model);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  CAPTURE(static_cast<int>(lens));
  Camera camera = fisheye_camera(width, height);
  camera.model = lens;
  if (lens == CameraModel::kOpenCv) {
    camera.fx = camera.fy = 0.67 * width;
    camera.distortion = {-0.12, 0.02, 0.0, 0.003, -0.002, 0.0};
  }
  if (lens == CameraModel::kOrthographic) camera.fx = camera.fy = 0.39 * width;
  const auto across = static_cast<std::size_t>(width);
  const std::size_t pixels = across * static_cast<std::size_t>(height);
  std::vector<float> gradient = random_image_gradient(pixels, 7);
  const reference::ColorMode mode = lens == CameraModel::kOrthographic
                                        ? reference::ColorMode::kAlongRay
                                        : reference::ColorMode::kFromOrigin;
  std::vector<reference::RayQuery> queries;
  std::vector<double> wide;
  std::vector<reference::RayTrace> expected;
  for (std::size_t i = 0; i < pixels; ++i) {
    const CameraRay ray = camera_ray(camera, static_cast<double>(i % across) + 0.5,
                                     static_cast<double>(i / across) + 0.5);
    queries.push_back({ray.origin, ray.direction, 0.0, ray.valid ? 1e30 : -1.0});
    expected.push_back(reference::trace_ray(parameters, options, ray.origin, ray.direction, 0.0,
                                            queries.back().t_max, mode));
    for (std::size_t c = 0; c < 4; ++c) {
      if (expected[i].margin < 1e-4) gradient[c * pixels + i] = 0.0f;
      wide.push_back(gradient[c * pixels + i]);
    }
  }
  ViewTracer tracer(context, options);
  const Traced got = trace_and_differentiate(context, tracer, gaussians, camera, gradient);
  std::size_t compared = 0;
  for (std::size_t i = 0; i < pixels; ++i) {
    if (expected[i].margin < 1e-4) continue;
    ++compared;
    for (std::size_t c = 0; c < 3; ++c) {
      CHECK(got.image.data[4 * i + c] ==
            doctest::Approx(expected[i].color[static_cast<int>(c)]).epsilon(2e-3));
    }
    CHECK(got.image.data[4 * i + 3] == doctest::Approx(expected[i].alpha).epsilon(2e-3));
  }
  CHECK(compared > pixels / 2);
  CHECK_ERRORS(
      errors_of(got.gradients, reference::ray_gradient(parameters, options, queries, wide, mode)),
      1e-3);
}

}  // namespace

TEST_CASE("pictures and gradients of distorted cameras equal the double reference [small]") {
  Context context = make_test_context();
  for (const CameraModel lens : {CameraModel::kFisheye, CameraModel::kOpenCv,
                                 CameraModel::kEquirectangular, CameraModel::kOrthographic}) {
    check_lens(context, reference::random_scene(40, 92, 1), lens, 18, 16);
  }
}

TEST_CASE("a few pixels and gradients of a fisheye equal the double reference [tiny]") {
  Context context = make_test_context();
  check_lens(context, reference::random_scene(10, 97, 1), CameraModel::kFisheye, 7, 6);
}

TEST_CASE("pictures of other cameras equal the double reference, by packets or rays [small]") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(300, 42, 2);
  const reference::Parameters parameters(model);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  TraceOptions options;
  options.background = {0.1f, 0.3f, 0.5f};
  options.depth = true;
  ViewTracer tracer(context, options);
  Camera opencv = view_of(CameraModel::kOpenCv, 28, 21, 22);
  opencv.distortion = {-0.1, 0.02, 0, 0.002, -0.003, 0};
  Camera panorama = view_of(CameraModel::kEquirectangular, 40, 20, 1);
  panorama.translation = {0, 0, 0.2};
  for (const Camera& camera : {opencv, view_of(CameraModel::kFisheye, 30, 30, 6), panorama,
                               view_of(CameraModel::kOrthographic, 28, 21, 10)}) {
    for (const bool one_by_one : {false, true}) {
      CAPTURE(static_cast<int>(camera.model));
      CAPTURE(one_by_one);
      if (one_by_one) {
        tracer.forward_rays(gaussians, camera);
      } else {
        tracer.forward(gaussians, camera);
      }
      const Image image = tracer.download_image();
      const Image depth = tracer.download_depth();
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
        const double worst = pixel_error(image, i, expected.color, expected.alpha);
        const double along =
            camera.model == CameraModel::kOpenCv ? glm::dot(axis, ray.direction) : 1.0;
        const double far = along * expected.expected_depth;
        wrong += worst < 2e-3 &&
                         std::abs(static_cast<double>(depth.data[3 * i]) - far) <= 2e-3 * (1 + far)
                     ? 0
                     : 1;
      }
      CHECK(wrong == 0);
      CHECK(compared * 2 > image.pixels());
      CHECK(hit > 50);
    }
  }
}
