// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <string>
#include <vector>

#include "scene/camera/camera_model.hpp"
#include "scene/image/pixel_count.hpp"
#include "trace/ray_launch.hpp"
#include "unit/trace/trace_fixture.hpp"

using namespace raysplats;

namespace {

// Tiles small enough for small pictures through wide lenses.
struct SmallTiles {
  SmallTiles() {
    DeviceTuning tuning;
    tuning.tile = 8;
    context.set_tuning(tuning);
  }
  Context context = make_test_context();
};

struct View {
  std::string name;
  Camera camera;
};

std::vector<View> views() {
  std::vector<View> out;
  const auto add = [&](const char* name, CameraModel model, int width, int height, double focal) {
    Camera camera = look_at({0.3, -0.2, -0.1}, {0.2, 0.1, 4.0}, {0.1, -1, 0}, width, height, focal);
    camera.model = model;
    out.push_back({name, camera});
  };
  add("pinhole", CameraModel::kPinhole, 28, 24, 22);
  add("opencv", CameraModel::kOpenCv, 28, 24, 22);
  out.back().camera.distortion.k1 = -0.05;
  add("fisheye", CameraModel::kFisheye, 24, 24, 9);
  add("panorama", CameraModel::kEquirectangular, 80, 40, 1);
  return out;
}

// Needles, discs and balls in front of the camera and, every third, anywhere around it, thinner and
// thicker than a pixel, each at a distance of its own: no small change alters the order of hits.
Gaussians thin_scene(std::size_t count) {
  Gaussians out = reference::random_scene(count, 31, 1);
  CounterRng rng(32, 6);
  for (std::size_t i = 0; i < count; ++i) {
    const double spread = i % 3 == 0 ? 20.0 : 0.35;
    const glm::dvec3 direction = glm::normalize(
        glm::dvec3(spread * rng.normal(), spread * rng.normal(), i % 3 == 0 ? rng.normal() : 1.0));
    for (std::size_t k = 0; k < 3; ++k) {
      out.means[3 * i + k] =
          static_cast<float>((2.0 + 0.4 * static_cast<double>(i)) * direction[static_cast<int>(k)]);
      // A twentieth of a pixel to two of them, at this distance and in the pinhole.
      out.log_scales[3 * i + k] = static_cast<float>(
          std::log((2.0 + 0.4 * static_cast<double>(i)) / 22.0) + rng.uniform() * 3.7 - 3.0);
    }
    out.opacities[i] = static_cast<float>(1.0 + rng.normal());
  }
  return out;
}

TraceOptions options_with(float footprint) {
  TraceOptions options = peak_order();
  options.adaptive_radius = false;
  options.quantile =
      40;  // what begins and ends at the border of an ellipsoid is too faint to count
  options.view_footprint = footprint;
  options.background = {0.2f, 0.4f, 0.6f};
  return options;
}

// The reference's picture, planes of R, G, B and coverage.
std::vector<double> expected_picture(const reference::Parameters& parameters,
                                     const TraceOptions& options,
                                     const Camera& camera) {
  const auto prepared = reference::prepare_view(parameters, options, camera);
  const std::size_t pixels = pixel_count(camera);
  std::vector<double> out(4 * pixels);
  for (std::size_t i = 0; i < pixels; ++i) {
    const auto width = static_cast<std::size_t>(camera.width);
    const CameraRay ray = camera_ray(camera, static_cast<double>(i % width) + 0.5,
                                     static_cast<double>(i / width) + 0.5);
    const reference::RayTrace seen =
        reference::trace_ray(parameters, prepared, options, ray.origin, ray.direction, 0.0,
                             ray.valid ? 1e30 : -1.0, reference::ColorMode::kFromOrigin);
    for (int c = 0; c < 3; ++c) out[static_cast<std::size_t>(c) * pixels + i] = seen.color[c];
    out[3 * pixels + i] = seen.alpha;
  }
  return out;
}

double loss_of(const reference::Parameters& parameters,
               const TraceOptions& options,
               const Camera& camera,
               const std::vector<float>& gradient) {
  const std::vector<double> picture = expected_picture(parameters, options, camera);
  double sum = 0;
  for (std::size_t i = 0; i < picture.size(); ++i)
    sum += picture[i] * static_cast<double>(gradient[i]);
  return sum;
}

// Central differences of the loss by every parameter.
reference::Parameters differences(reference::Parameters parameters,
                                  const TraceOptions& options,
                                  const Camera& camera,
                                  const std::vector<float>& gradient) {
  constexpr double kStep = 1e-5;
  reference::Parameters out = parameters.zeros();
  for (std::size_t i = 0; i < parameters.scalar_count(); ++i) {
    const double value = parameters.at(i);
    parameters.at(i) = value + kStep;
    const double above = loss_of(parameters, options, camera, gradient);
    parameters.at(i) = value - kStep;
    const double below = loss_of(parameters, options, camera, gradient);
    parameters.at(i) = value;
    out.at(i) = (above - below) / (2 * kStep);
  }
  return out;
}

void check_gradients(Context& context,
                     const Gaussians& model,
                     const Camera& camera,
                     ScaleActivation activation) {
  const TraceOptions options = options_with(0.5f);
  const std::vector<float> gradient = random_image_gradient(pixel_count(camera), 7);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, activation);
  CameraTracer tracer(context, options);
  tracer.update(gaussians);
  tracer.forward(gaussians, camera, true);
  const reference::Parameters parameters(model, activation);
  CHECK_ERRORS(errors_of(backward(context, tracer, gaussians, gradient),
                         differences(parameters, options, camera, gradient)),
               1e-3);
}

}  // namespace

TEST_CASE("a view's footprint shows the picture of the double reference") {
  SmallTiles tiles;
  Context& context = tiles.context;
  const Gaussians model = thin_scene(14);
  const reference::Parameters parameters(model);
  for (const View& view : views()) {
    CAPTURE(view.name);
    const TraceOptions options = options_with(0.5f);
    const std::vector<double> expected = expected_picture(parameters, options, view.camera);
    const std::vector<double> without = expected_picture(parameters, options_with(0), view.camera);
    const Image image = trace_image(context, model, options, view.camera);
    double worst = 0, changed = 0;
    for (std::size_t i = 0; i < image.pixels(); ++i) {
      for (std::size_t c = 0; c < 4; ++c) {
        const double value = expected[c * image.pixels() + i];
        worst = std::max(worst, std::abs(static_cast<double>(image.data[4 * i + c]) - value));
        changed = std::max(changed, std::abs(without[c * image.pixels() + i] - value));
      }
    }
    CHECK(worst < 2e-4);
    CHECK(changed > 0.1);
  }
}

TEST_CASE("gradients through a view's footprint are differences of the reference") {
  SmallTiles tiles;
  for (const View& view : views()) {
    for (const ScaleActivation activation : {ScaleActivation::kExp, ScaleActivation::kSigmoid}) {
      CAPTURE(view.name);
      CAPTURE(static_cast<int>(activation));
      check_gradients(tiles.context, thin_scene(14), view.camera, activation);
    }
  }
}

TEST_CASE("gradients of a few pixels through a view's footprint [tiny]") {
  SmallTiles tiles;
  Camera camera = views().front().camera;
  camera.width = camera.height = 8;
  camera.cx = camera.cy = 4;
  check_gradients(tiles.context, thin_scene(6), camera, ScaleActivation::kExp);
}

TEST_CASE("the gradient of a pose through a view's footprint") {
  constexpr double kStep = 1e-5;
  SmallTiles tiles;
  Context& context = tiles.context;
  const Gaussians model = thin_scene(14);
  const reference::Parameters parameters(model);
  const TraceOptions options = options_with(0.5f);
  for (const View& view : views()) {
    CAPTURE(view.name);
    const std::vector<float> numbers = random_image_gradient(pixel_count(view.camera), 7);
    const DeviceGaussians gaussians =
        DeviceGaussians::upload(context, model, ScaleActivation::kExp);
    CameraTracer tracer(context, options);
    tracer.update(gaussians);
    tracer.forward(gaussians, view.camera, true);
    Buffer<float> gradient(context, numbers.size(), "image gradient");
    gradient.upload(numbers);
    GaussianGradients sums;
    PoseGradient pose;
    tracer.backward(gaussians, gradient, sums, &pose);
    const auto loss_at = [&](const glm::dvec3& shift, const glm::dvec3& turn) {
      Camera moved = view.camera;
      const glm::dvec3 center = moved.center() + shift;
      const double angle = glm::length(turn);
      if (angle > 0) {
        moved.rotation =
            glm::dmat3(glm::rotate(glm::dmat4(1.0), angle, turn / angle)) * moved.rotation;
      }
      moved.translation = -(moved.rotation * center);
      return loss_of(parameters, options, moved, numbers);
    };
    for (int j = 0; j < 3; ++j) {
      glm::dvec3 step(0.0);
      step[j] = kStep;
      const glm::dvec3 none(0.0);
      const auto k = static_cast<std::size_t>(j);
      const double by_center = (loss_at(step, none) - loss_at(-step, none)) / (2 * kStep);
      const double by_turn = (loss_at(none, step) - loss_at(none, -step)) / (2 * kStep);
      CHECK(pose.center[k] == doctest::Approx(by_center).epsilon(2e-3));
      CHECK(pose.rotation[k] == doctest::Approx(by_turn).epsilon(2e-3));
    }
  }
}

TEST_CASE("what a device is tuned to does not take the footprint from a view") {
  DeviceInfo device = test_device();
  device.tuning.emplace().bvh = true;
  TraceOptions options;
  CHECK(walks_tree(options, device));
  options.view_footprint = 0.3f;
  CHECK(!walks_tree(options, device));
}

TEST_CASE("what a Gaussian thinner than a pixel adds to a picture does not depend on its place") {
  Context context = make_test_context();
  const TraceOptions options = options_with(0.5f);
  Gaussians model = reference::random_scene(1, 5, 0);
  model.log_scales = {-5.0f, -5.5f, -7.0f};  // a twentieth of a pixel, and less
  model.opacities = {2.0f};
  double least = 1e30, most = 0, least_without = 1e30, most_without = 0;
  for (int step = 0; step < 8; ++step) {
    model.means = {0.02f * static_cast<float>(step), 0.013f * static_cast<float>(step), 0.0f};
    const auto sum = [&](const TraceOptions& shown) {
      const Image image = trace_image(context, model, shown, reference::cube_camera(24, 24));
      double all = 0;
      for (std::size_t i = 0; i < image.pixels(); ++i)
        all += static_cast<double>(image.data[4 * i + 3]);
      return all;
    };
    const double now = sum(options), before = sum(options_with(0));
    least = std::min(least, now);
    most = std::max(most, now);
    least_without = std::min(least_without, before);
    most_without = std::max(most_without, before);
  }
  CHECK(least > 0);
  CHECK(most < 1.1 * least);
  CHECK(most_without > 10 * least_without);
}
