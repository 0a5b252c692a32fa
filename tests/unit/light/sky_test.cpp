// SPDX-License-Identifier: Apache-2.0
#include "trace/sky.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <glm/gtc/matrix_transform.hpp>

#include "raysplats/error.hpp"
#include "raysplats/path_tracer.hpp"
#include "raysplats/tracer.hpp"
#include "reference/sky.hpp"
#include "scene/camera/camera_model.hpp"
#include "scene/gaussians/gaussian_transform.hpp"
#include "scene/image/pixel_count.hpp"
#include "unit/light/view_fixture.hpp"

using namespace raysplats;

namespace {

SkyLight random_sky(int degree, std::uint64_t seed) {
  CounterRng rng(seed, 31);
  SkyLight out(static_cast<std::size_t>((degree + 1) * (degree + 1)));
  for (auto& coefficient : out) {
    for (float& value : coefficient) value = static_cast<float>(0.4 * rng.normal());
  }
  return out;
}

Camera lens_of(CameraModel model, int width, int height) {
  Camera camera = fisheye_camera(width, height);
  camera.model = model;
  if (model == CameraModel::kPinhole) camera.distortion = {};
  if (model == CameraModel::kOpenCv) camera.distortion = {-0.12, 0.02, 0.0, 0.003, -0.002, 0.0};
  if (model == CameraModel::kPinhole || model == CameraModel::kOpenCv)
    camera.fx = camera.fy = 0.67 * width;
  if (model == CameraModel::kOrthographic) camera.fx = camera.fy = 0.39 * width;
  return camera;
}

// What the double reference says of a view; `gradient` is made 0 where rays are near a decision.
struct Expected {
  std::vector<reference::RayTrace> rays;
  std::vector<bool> valid;
  reference::Parameters gradients;
  std::vector<double> sky;
};

Expected expected_of(const reference::Parameters& parameters,
                     const TraceOptions& options,
                     const Camera& camera,
                     std::vector<float>& gradient) {
  const auto mode = camera.model == CameraModel::kOrthographic ? reference::ColorMode::kAlongRay
                                                               : reference::ColorMode::kFromOrigin;
  const auto across = static_cast<std::size_t>(camera.width);
  const std::size_t pixels = across * static_cast<std::size_t>(camera.height);
  Expected out;
  out.sky.resize(3 * options.sky.size());
  std::vector<reference::RayQuery> queries;
  std::vector<double> wide;
  for (std::size_t i = 0; i < pixels; ++i) {
    const CameraRay ray = camera_ray(camera, static_cast<double>(i % across) + 0.5,
                                     static_cast<double>(i / across) + 0.5);
    const double end = ray.valid ? 1e30 : -1.0;
    out.valid.push_back(ray.valid);
    out.rays.push_back(
        reference::trace_ray(parameters, options, ray.origin, ray.direction, 0.0, end, mode));
    for (std::size_t c = 0; c < 4; ++c) {
      if (out.rays[i].margin < 1e-4) gradient[c * pixels + i] = 0.0f;
      if (ray.valid) wide.push_back(gradient[c * pixels + i]);
    }
    if (!ray.valid) continue;
    queries.push_back({ray.origin, ray.direction, 0.0, end});
    glm::dvec3 passed(gradient[i], gradient[pixels + i], gradient[2 * pixels + i]);
    passed *= out.rays[i].transmittance;
    const std::vector<double> part = reference::sky_gradient(options, ray.direction, passed);
    for (std::size_t k = 0; k < part.size(); ++k) out.sky[k] += part[k];
  }
  out.gradients = reference::ray_gradient(parameters, options, queries, wide, mode);
  return out;
}

void check_view(Context& context,
                const Gaussians& model,
                const TraceOptions& options,
                const Camera& camera,
                bool by_rays) {
  const std::size_t pixels = pixel_count(camera);
  std::vector<float> gradient = random_image_gradient(pixels, 7);
  const Expected expected = expected_of(reference::Parameters(model), options, camera, gradient);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  ViewTracer tracer(context, options);
  const Traced got = trace_and_differentiate(context, tracer, gaussians, camera, gradient, by_rays);
  std::size_t compared = 0, wrong = 0, seen = 0;
  for (std::size_t i = 0; i < pixels; ++i) {
    const float* color = &got.image.data[4 * i];
    if (!expected.valid[i]) {
      wrong += color[0] == 0.0f && color[1] == 0.0f && color[3] == 0.0f ? 0 : 1;
      continue;
    }
    const reference::RayTrace& ray = expected.rays[i];
    if (ray.margin < 1e-4) continue;
    ++compared;
    seen += ray.transmittance > 0.1 ? 1 : 0;
    for (std::size_t c = 0; c < 3; ++c) {
      const double difference = static_cast<double>(color[c]) - ray.color[static_cast<int>(c)];
      wrong += std::abs(difference) < 2e-3 ? 0 : 1;
    }
    wrong += std::abs(static_cast<double>(color[3]) - ray.alpha) < 2e-3 ? 0 : 1;
  }
  CHECK(wrong == 0);
  CHECK(compared * 2 > pixels);
  CHECK(seen > pixels / 8);
  CHECK_ERRORS(errors_of(got.gradients, expected.gradients), 1e-3);
  REQUIRE(tracer.sky() != nullptr);
  CHECK(relative_error(tracer.sky()->gradient().download(), expected.sky) < 1e-3);
}

TraceOptions under_sky(int degree, std::uint64_t seed) {
  TraceOptions options;
  options.hit_order = HitOrder::kPeak;
  options.background = {0.3f, 0.2f, 0.1f};  // a sky takes its place
  options.sky = random_sky(degree, seed);
  return options;
}

}  // namespace

TEST_CASE(
    "views under a sky and their gradients equal the double reference in every lens [small]") {
  Context context = make_test_context();
  int degree = 0;
  for (const CameraModel model :
       {CameraModel::kPinhole, CameraModel::kFisheye, CameraModel::kOpenCv,
        CameraModel::kEquirectangular, CameraModel::kOrthographic}) {
    for (const bool by_rays : {false, true}) {
      CAPTURE(static_cast<int>(model));
      CAPTURE(by_rays);
      check_view(context, reference::random_scene(40, 92, 1), under_sky(degree, 3),
                 lens_of(model, 18, 16), by_rays);
    }
    ++degree;
  }
}

TEST_CASE(
    "packets of every shape see the same sky, whether hits are kept or traced again [small]") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(300, 93, 1);
  for (const auto& [shape, width] :
       {std::pair{PacketShape::kVector, 1}, std::pair{PacketShape::kVector, 8},
        std::pair{PacketShape::kVector, 16}, std::pair{PacketShape::kGroup, 8},
        std::pair{PacketShape::kGroup, 32}}) {
    CAPTURE(static_cast<int>(shape));
    CAPTURE(width);
    TraceOptions options = under_sky(2, 5);
    options.packet_shape = shape;
    options.packet_width = width;
    check_view(context, model, options, lens_of(CameraModel::kPinhole, 34, 27), false);
    options.memory_budget = 1000;
    check_view(context, model, options, lens_of(CameraModel::kPinhole, 34, 27), false);
  }
}

TEST_CASE("a sky changes from view to view and goes again [small]") {
  Context context = make_test_context();
  const Model model(context, reference::random_scene(30, 95, 0));
  const Camera camera = lens_of(CameraModel::kPinhole, 20, 20);
  const TraceOptions options = under_sky(2, 8);
  TraceOptions plain = options;
  plain.sky.clear();
  Tracer tracer(context, options), expected(context, plain);
  const Image under = tracer.render(model, camera, true);
  Image ones = under;
  for (float& value : ones.data) value = 1.0f;
  const ViewGradients gradients = tracer.backward(model, ones);
  CHECK(gradients.sky.size() == options.sky.size());
  CHECK(std::isnan(gradients.pose.center[0]));
  tracer.set_background(plain.background);
  CHECK(tracer.render(model, camera).data == expected.render(model, camera).data);
  tracer.set_background({}, options.sky);
  CHECK(tracer.render(model, camera).data == under.data);
  CHECK_THROWS_AS(tracer.backward(model, ones), UsageError);
}

TEST_CASE("the environment of a scene is the sky of its model, turned with it [small]") {
  Context context = make_test_context();
  Scene scene;
  scene.gaussians = reference::random_scene(60, 97, 1);
  scene.trace = under_sky(4, 9);
  scene.environment.color = {1, 1, 1};
  scene.environment.up = {0.3f, -1.0f, 0.2f};
  scene.environment.sky = scene.trace.sky;
  Camera camera = lens_of(CameraModel::kEquirectangular, 48, 24);
  Tracer tracer(context, scene.trace);
  const auto check = [&](const Image& expected, const Image& got) {
    double worst = 0;
    for (std::size_t i = 0; i < got.data.size(); ++i)
      worst = std::max(worst, static_cast<double>(std::abs(got.data[i] - expected.data[i])));
    CHECK(worst < 4e-3);
  };
  const Image expected = tracer.render(Model(context, scene.gaussians), camera);
  check(expected, PathTracer(context, scene).render(camera));

  // All of it turned, and the camera too, is the same picture.
  glm::dmat4 turn(1.0);
  turn = glm::rotate(turn, 0.7, glm::dvec3(1, 2, -0.5));
  scene.gaussians = transformed(scene.gaussians, turn);
  scene.environment.sky = transformed(scene.environment.sky, turn);
  camera.rotation = camera.rotation * glm::transpose(glm::dmat3(turn));
  check(expected, PathTracer(context, scene).render(camera));
  TraceOptions turned = scene.trace;
  turned.sky = scene.environment.sky;
  Tracer other(context, turned);
  check(expected, other.render(Model(context, scene.gaussians), camera));
}

TEST_CASE("skies that cannot be are refused [small]") {
  Context context = make_test_context();
  TraceOptions options = under_sky(1, 2);
  const Panel panel{{-1, -1, 2}, {2, 0, 0}, {0, 2, 0}, glm::dvec3(1)};
  CHECK_THROWS_AS(ViewTracer(context, options, mirrors_of({panel}, 1)), UsageError);
  const Model model(context, reference::random_scene(5, 96, 0));
  Tracer tracer(context, options);
  const std::vector<Ray> rays(1, Ray{{0, 0, -3}, 0, {0, 0, 1}, 100});
  CHECK_THROWS_AS(tracer.trace(model, rays), UsageError);
  CHECK_THROWS_AS(tracer.set_background({}, SkyLight(3)), UsageError);
  CHECK_NOTHROW(tracer.render(model, lens_of(CameraModel::kPinhole, 4, 4)));
  options.sky[2][1] = NAN;
  CHECK_THROWS_AS(ViewTracer(context, options), UsageError);
}
