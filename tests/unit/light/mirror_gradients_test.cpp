// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <glm/geometric.hpp>

#include "scene/camera/camera_model.hpp"
#include "trace/gradient_sums.hpp"
#include "unit/light/view_fixture.hpp"

using namespace raysplats;

namespace {

// What a pixel sees through mirrors, and the hits on the way.
struct Seen {
  glm::dvec3 color{0.0};
  double alpha = 0.0;
  double margin = 1.0;
  std::vector<std::uint32_t> hits;
};

Seen see(const reference::Parameters& parameters,
         const TraceOptions& options,
         const std::vector<Panel>& panels,
         int max_bounces,
         const CameraRay& ray,
         reference::Cone cone = {}) {
  Seen out;
  const glm::dvec3 background(options.background[0], options.background[1], options.background[2]);
  TraceOptions dark = options;
  dark.background = {0, 0, 0};
  glm::dvec3 origin = ray.origin, direction = ray.direction, weight(1.0);
  double passed = 1.0;
  const Panel* from = nullptr;
  for (int bounce = 0;; ++bounce) {
    double t_end = 1e30;
    const Panel* met = nullptr;
    glm::dvec3 normal(0.0);
    for (const Panel& panel : panels) {
      const glm::dvec3 n = glm::normalize(glm::cross(panel.a, panel.b));
      const double t = glm::dot(panel.corner - origin, n) / glm::dot(direction, n);
      if (&panel == from || !(t > 0.0) || t >= t_end) continue;
      const glm::dvec3 p = origin + t * direction - panel.corner;
      const double u = glm::dot(p, panel.a) / glm::dot(panel.a, panel.a);
      const double v = glm::dot(p, panel.b) / glm::dot(panel.b, panel.b);
      out.margin =
          std::min({out.margin, std::abs(u), std::abs(v), std::abs(1 - u), std::abs(1 - v)});
      if (u < 0 || u > 1 || v < 0 || v > 1) continue;
      t_end = t;
      met = &panel;
      normal = n;
    }
    const reference::RayTrace traced = reference::trace_ray(
        parameters, reference::prepare(parameters, dark), dark, origin, direction, 0.0, t_end,
        bounce == 0 ? reference::ColorMode::kFromOrigin : reference::ColorMode::kAlongRay, cone);
    out.margin = std::min(out.margin, traced.margin);
    for (const reference::Hit& hit : traced.hits) out.hits.push_back(hit.index);
    out.hits.push_back(0xffffffffu);
    out.color += weight * traced.color;
    weight *= traced.transmittance;
    passed *= traced.transmittance;
    if (met == nullptr) {
      out.color += weight * background;
      break;
    }
    if (bounce == max_bounces) {
      passed = 0.0;
      break;
    }
    weight *= met->tint;
    origin += t_end * direction;
    cone.width += cone.spread * t_end;
    direction -= 2.0 * glm::dot(direction, normal) * normal;
    from = met;
  }
  out.alpha = 1.0 - passed;
  return out;
}

}  // namespace

TEST_CASE("gradients through mirrors in exact sums are those in copies, in any batches") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(300, 96, 1);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  const std::vector<Panel> panels{{{-2, -2, 1.3}, {4, 0, 0}, {0, 4, 0}, {0.9, 0.7, 0.8}},
                                  {{1.4, -2, -1.5}, {0.3, 0, 2.9}, {0, 4, 0}, {0.5, 0.9, 0.6}}};
  const Camera camera = reference::cube_camera(80, 70);
  const std::vector<float> noise = random_image_gradient(80 * 70, 9);
  const auto gradients = [&](GradientSum sum, std::size_t budget) {
    TraceOptions options;
    options.gradient_sum = sum;
    options.memory_budget = budget;
    ViewTracer tracer(context, options, mirrors_of(panels, 3));
    return trace_and_differentiate(context, tracer, gaussians, camera, noise).gradients;
  };
  const std::size_t large = std::size_t{1} << 28;
  const HostGradients exact = gradients(GradientSum::kExact, large);
  CHECK_ERRORS(errors_of(exact, gradients(GradientSum::kCopies, large)), 1e-5);
  CHECK_ERRORS(errors_of(exact, gradients(GradientSum::kAtomic, large)), 1e-5);
  CHECK(gradients(GradientSum::kExact, 1000) == exact);
  const HostGradients crowded = gradients(GradientSum::kCopies, 1000);
  if (context.device().compute_units > GradientSumChoice::kExactCopies) CHECK(crowded == exact);
  CHECK_ERRORS(errors_of(exact, crowded), 1e-5);
}

TEST_CASE("gradients through mirrors equal finite differences of a double reference [small]") {
  Context context = make_test_context();
  Gaussians model = reference::random_scene(14, 93, 1);
  for (float& scale : model.log_scales) scale = std::min(scale, std::log(0.3f));
  TraceOptions options;
  options.background = {0.3f, 0.5f, 0.2f};
  const reference::Parameters parameters(model);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  Camera camera = reference::cube_camera(14, 12);
  camera.fx = camera.fy = 14;
  camera.rotation = look_at({0, 0, -4}, {0.3, 0.1, 0}, {0, -1, 0}, 14, 12, 14).rotation;
  camera.translation = -(camera.rotation * glm::dvec3(0, 0, -4));
  // A wall behind the Gaussians and a tilted one beside them: some rays meet both.
  const std::vector<Panel> panels{{{-2, -2, 1.3}, {4, 0, 0}, {0, 4, 0}, {0.9, 0.7, 0.8}},
                                  {{1.4, -2, -1.5}, {0.3, 0, 2.9}, {0, 4, 0}, {0.5, 0.9, 0.6}}};
  const std::size_t pixels = 14 * 12;
  for (const int bounces : {0, 1, 3}) {
    CAPTURE(bounces);
    std::vector<float> gradient = random_image_gradient(pixels, 8);
    std::vector<CameraRay> rays;
    std::vector<Seen> at;
    std::size_t reflected = 0, twice = 0, left_out = 0;
    for (std::size_t i = 0; i < pixels; ++i) {
      const std::size_t x = i % 14, y = i / 14;
      rays.push_back(
          camera_ray(camera, static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5));
      at.push_back(see(parameters, options, panels, bounces, rays[i]));
      const auto segments = std::count(at[i].hits.begin(), at[i].hits.end(), 0xffffffffu);
      reflected += segments > 1 ? 1 : 0;
      twice += segments > 2 ? 1 : 0;
      if (at[i].margin >= 1e-4) continue;
      ++left_out;
      for (std::size_t c = 0; c < 4; ++c) gradient[c * pixels + i] = 0.0f;
    }
    CHECK(left_out < pixels / 4);
    CHECK((reflected > 40) == (bounces > 0));
    CHECK((twice > 4) == (bounces > 1));

    ViewTracer tracer(context, options, mirrors_of(panels, bounces));
    const Traced got = trace_and_differentiate(context, tracer, gaussians, camera, gradient);
    for (std::size_t i = 0; i < pixels; ++i) {
      if (at[i].margin < 1e-4) continue;
      CAPTURE(i);
      for (std::size_t c = 0; c < 3; ++c) {
        CHECK(got.image.data[4 * i + c] ==
              doctest::Approx(at[i].color[static_cast<int>(c)]).epsilon(2e-3));
      }
      CHECK(got.image.data[4 * i + 3] == doctest::Approx(at[i].alpha).epsilon(2e-3));
    }

    const double step = 1e-5;
    reference::Parameters numeric = parameters.zeros();
    for (std::size_t n = 0; n < parameters.scalar_count(); ++n) {
      reference::Parameters plus = parameters, minus = parameters;
      plus.at(n) += step;
      minus.at(n) -= step;
      for (std::size_t i = 0; i < pixels; ++i) {
        if (at[i].margin < 1e-4) continue;
        const Seen above = see(plus, options, panels, bounces, rays[i]);
        const Seen below = see(minus, options, panels, bounces, rays[i]);
        REQUIRE(above.hits == at[i].hits);
        REQUIRE(below.hits == at[i].hits);
        double change = gradient[3 * pixels + i] * (above.alpha - below.alpha);
        for (std::size_t c = 0; c < 3; ++c) {
          const int k = static_cast<int>(c);
          change += gradient[c * pixels + i] * (above.color[k] - below.color[k]);
        }
        numeric.at(n) += change / (2.0 * step);
      }
    }
    CHECK_ERRORS(errors_of(got.gradients, numeric), 1e-3);
  }
}

TEST_CASE("mirrors show the footprint of a view, in any batches [small]") {
  Context context = make_test_context();
  Gaussians model = reference::random_scene(60, 94, 1);
  for (float& scale : model.log_scales) scale -= 1.5f;
  TraceOptions options = peak_order();
  options.view_footprint = 0.6f;
  options.background = {0.3f, 0.5f, 0.2f};
  const reference::Parameters parameters(model);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  const Camera camera = look_at({0, 0, -4}, {0.3, 0.1, 0}, {0, -1, 0}, 80, 70, 60);
  const std::vector<Panel> panels{{{-2, -2, 1.3}, {4, 0, 0}, {0, 4, 0}, {0.9, 0.7, 0.8}},
                                  {{1.4, -2, -1.5}, {0.3, 0, 2.9}, {0, 4, 0}, {0.5, 0.9, 0.6}}};
  ViewTracer tracer(context, options, mirrors_of(panels, 3));
  tracer.forward(gaussians, camera);
  const Image image = tracer.download_image();
  std::size_t compared = 0, wrong = 0, reflected = 0;
  for (std::size_t i = 0; i < image.pixels(); i += 7) {
    const std::size_t x = i % 80, y = i / 80;
    const CameraRay ray =
        camera_ray(camera, static_cast<double>(x) + 0.5, static_cast<double>(y) + 0.5);
    const Seen expected = see(parameters, options, panels, 3, ray,
                              reference::pixel_cone(camera, options, ray.direction));
    if (expected.margin < 1e-4) continue;
    ++compared;
    reflected += std::count(expected.hits.begin(), expected.hits.end(), 0xffffffffu) > 1 ? 1 : 0;
    wrong += pixel_error(image, i, expected.color, expected.alpha) < 2e-3 ? 0 : 1;
  }
  CHECK(wrong == 0);
  CHECK(compared > 500);
  CHECK(reflected > 300);
  options.memory_budget = 1000;
  ViewTracer in_batches(context, options, mirrors_of(panels, 3));
  in_batches.forward(gaussians, camera);
  CHECK(in_batches.download_image().data == image.data);
}
