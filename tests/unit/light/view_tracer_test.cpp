// SPDX-License-Identifier: Apache-2.0
#include "light/view_tracer.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "core/camera_model.hpp"
#include "raysplats/error.hpp"
#include "trace/camera_tracer.hpp"
#include "unit/trace/trace_fixture.hpp"

using namespace raysplats;

namespace {

struct Host {
  std::vector<float> means, quaternions, scales, opacities, sh, screen;

  explicit Host(const GaussianGradients& g)
      : means(g.means.download()),
        quaternions(g.quaternions.download()),
        scales(g.scales.download()),
        opacities(g.opacities.download()),
        sh(g.sh.download()),
        screen(g.screen.download()) {}
  bool operator==(const Host&) const = default;
};

template <class Expected>
void check_gradients(const Host& got, const Expected& expected, double limit) {
  const auto check = [&](const char* what, const std::vector<float>& a, const auto& b) {
    CAPTURE(what);
    CHECK(relative_error(a, std::vector<double>(b.begin(), b.end())) < limit);
  };
  check("means", got.means, expected.means);
  check("quaternions", got.quaternions, expected.quaternions);
  check("scales", got.scales, expected.scales);
  check("opacities", got.opacities, expected.opacities);
  check("sh", got.sh, expected.sh);
}

struct Traced {
  Image image;
  Host gradients;
};

// `by_rays`: whatever the model of the camera.
Traced trace_and_differentiate(Context& context,
                               ViewTracer& tracer,
                               const DeviceGaussians& gaussians,
                               const Camera& camera,
                               const std::vector<float>& image_gradient,
                               bool by_rays = false) {
  if (by_rays) {
    tracer.forward_rays(gaussians, camera, true);
  } else {
    tracer.forward(gaussians, camera, true);
  }
  Buffer<float> gradient(context, image_gradient.size(), "image gradient");
  gradient.upload(image_gradient);
  GaussianGradients out;
  tracer.backward(gaussians, gradient, out);
  return {tracer.download_image(), Host(out)};
}

// A flat mirror in double precision.
struct Panel {
  glm::dvec3 corner, a, b;  // the rectangle corner + u a + v b
  glm::dvec3 tint;
};

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
         const CameraRay& ray) {
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
        parameters, dark, origin, direction, 0.0, t_end,
        bounce == 0 ? reference::ColorMode::kFromOrigin : reference::ColorMode::kAlongRay);
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
    direction -= 2.0 * glm::dot(direction, normal) * normal;
    from = met;
  }
  out.alpha = 1.0 - passed;
  return out;
}

Mirrors mirrors_of(const std::vector<Panel>& panels, int max_bounces) {
  Mirrors out;
  out.max_bounces = max_bounces;
  for (const Panel& panel : panels) {
    Mesh mesh;
    for (const glm::dvec3& p : {panel.corner, panel.corner + panel.a,
                                panel.corner + panel.a + panel.b, panel.corner + panel.b}) {
      for (int k = 0; k < 3; ++k) mesh.positions.push_back(static_cast<float>(p[k]));
    }
    mesh.triangles = {0, 1, 2, 0, 2, 3};
    mesh.materials.assign(2, static_cast<std::uint32_t>(out.materials.size()));
    Material material;
    material.kind = Material::Kind::kMirror;
    for (int k = 0; k < 3; ++k)
      material.color[static_cast<std::size_t>(k)] = static_cast<float>(panel.tint[k]);
    out.materials.push_back(material);
    out.meshes.push_back(mesh);
  }
  return out;
}

Camera fisheye_camera(int width, int height) {
  Camera camera = reference::cube_camera(width, height);
  camera.model = CameraModel::kFisheye;
  camera.translation = {0.0, 0.0, 2.2};
  camera.fx = camera.fy = 0.35 * width;
  camera.distortion.k1 = -0.03;
  camera.distortion.k2 = 0.004;
  return camera;
}

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
  check_gradients(got.gradients, reference::ray_gradient(parameters, options, queries, wide, mode),
                  1e-3);
}

Camera view_of(CameraModel model, int width, int height, double focal) {
  Camera camera = look_at({0.4, -0.3, -2.6}, {0, 0, 0}, {0, -1, 0}, width, height, focal);
  camera.model = model;
  return camera;
}

}  // namespace

TEST_CASE("a pinhole's gradients ray by ray are those of packets") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(800, 91, 2);
  const Camera camera = look_at({0.4, -0.6, -4.0}, {0, 0, 0}, {0, 1, 0}, 66, 58, 80);
  TraceOptions options;
  options.background = {0.3f, 0.2f, 0.1f};
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  const reference::Render render = reference::render(reference::Parameters(model), options, camera);
  std::vector<float> gradient = random_image_gradient(render.pixels(), 5);
  for (std::size_t i = 0; i < render.pixels(); ++i) {
    if (render.margin[i] >= 1e-4) continue;
    for (std::size_t c = 0; c < 4; ++c) gradient[c * render.pixels() + i] = 0.0f;
  }
  ViewTracer packets(context, options), rays(context, options);
  const Traced expected = trace_and_differentiate(context, packets, gaussians, camera, gradient);
  const Traced got = trace_and_differentiate(context, rays, gaussians, camera, gradient, true);
  CHECK(compare(got.image, render).maximum < 2e-3);
  check_gradients(got.gradients, expected.gradients, 1e-3);

  // In batches that are traced again; 58 x 66 pixels are less than one.
  const Camera large = look_at({0.4, -0.6, -4.0}, {0, 0, 0}, {0, 1, 0}, 110, 90, 150);
  const std::vector<float> noise = random_image_gradient(110 * 90, 6);
  TraceOptions tight = options;
  tight.memory_budget = 1000;
  ViewTracer batches(context, tight);
  const Traced whole = trace_and_differentiate(context, rays, gaussians, large, noise, true);
  const Traced parts = trace_and_differentiate(context, batches, gaussians, large, noise, true);
  CHECK(whole.image.data == parts.image.data);
  check_gradients(parts.gradients, whole.gradients, 1e-4);
  // Exact sums do not notice the batches.
  options.gradient_sum = tight.gradient_sum = GradientSum::kExact;
  ViewTracer exact(context, options), exact_batches(context, tight);
  CHECK(trace_and_differentiate(context, exact, gaussians, large, noise, true).gradients ==
        trace_and_differentiate(context, exact_batches, gaussians, large, noise, true).gradients);
}

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
  const Host exact = gradients(GradientSum::kExact, large);
  check_gradients(exact, gradients(GradientSum::kCopies, large), 1e-5);
  check_gradients(exact, gradients(GradientSum::kAtomic, large), 1e-5);
  CHECK(gradients(GradientSum::kExact, 1000) == exact);
  CHECK(gradients(GradientSum::kCopies, 1000) == exact);
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
      rays.push_back(
          camera_ray(camera, static_cast<double>(i % 14) + 0.5, static_cast<double>(i / 14) + 0.5));
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
    check_gradients(got.gradients, numeric, 1e-3);
  }
}

TEST_CASE("camera rays through the tree have the picture and the gradients of the tiles") {
  Context context = make_test_context();
  Camera camera = look_at({0.4, -0.6, -4.0}, {0, 0, 0}, {0, 1, 0}, 60, 52, 80);
  for (const int degree : {0, 3}) {
    for (const HitOrder order : {HitOrder::kEntry, HitOrder::kPeak}) {
      for (const float near : {0.0f, 3.7f}) {
        CAPTURE(degree);
        CAPTURE(static_cast<int>(order));
        CAPTURE(near);
        const Gaussians model = reference::random_scene(900, 78, degree);
        const DeviceGaussians gaussians =
            DeviceGaussians::upload(context, model, ScaleActivation::kExp);
        TraceOptions options;
        options.hit_order = order;
        options.near_depth = near;
        options.background = {0.3f, 0.2f, 0.1f};
        // Rays on which single precision may decide otherwise pull at nothing.
        const reference::Render expected =
            reference::render(reference::Parameters(model), options, camera);
        std::vector<float> gradient = random_image_gradient(expected.pixels(), 7);
        std::size_t compared = 0;
        for (std::size_t i = 0; i < expected.pixels(); ++i) {
          const bool tie = expected.margin[i] < 1e-4;
          compared += tie ? 0 : 1;
          for (std::size_t c = 0; c < 4 && tie; ++c) gradient[c * expected.pixels() + i] = 0.0f;
        }
        CHECK(2 * compared > expected.pixels());
        options.traversal = Traversal::kTiles;
        ViewTracer tiles(context, options);
        options.traversal = Traversal::kBvh;
        ViewTracer tree(context, options);
        CHECK_FALSE(tiles.by_rays(camera));
        CHECK(tree.by_rays(camera));
        const Traced a = trace_and_differentiate(context, tiles, gaussians, camera, gradient);
        const Traced b = trace_and_differentiate(context, tree, gaussians, camera, gradient);
        CHECK(compare(a.image, expected).maximum < 2e-3);
        CHECK(compare(b.image, expected).maximum < 2e-3);
        check_gradients(b.gradients, a.gradients, 1e-3);
      }
    }
  }
}

TEST_CASE("what a tracer of rays refuses, and a tree that is refitted") {
  Context context = make_test_context();
  TraceOptions near;
  near.near_depth = 0.5f;
  TraceOptions deep;
  deep.depth = true;
  CHECK_THROWS_AS(
      ViewTracer(context, deep, mirrors_of({{{-2, -2, 1}, {4, 0, 0}, {0, 4, 0}, {1, 1, 1}}}, 1)),
      UsageError);
  const Panel panel{{-1, -1, 2}, {2, 0, 0}, {0, 2, 0}, glm::dvec3(1)};
  CHECK_THROWS_AS(ViewTracer(context, near, mirrors_of({panel}, 1)), UsageError);
  CHECK_NOTHROW(ViewTracer(context, near));
  Mirrors endless;
  endless.max_bounces = -1;
  CHECK_THROWS_AS(ViewTracer(context, {}, endless), UsageError);
  ViewTracer tracer(context, {});
  Gaussians model = reference::random_scene(300, 94, 0);
  const Camera camera = fisheye_camera(30, 30);
  Buffer<float> gradient(context, 4 * 900, "image gradient");
  gradient.clear();
  GaussianGradients out;
  DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  TraceOptions tiled;
  tiled.traversal = Traversal::kTiles;
  CHECK_THROWS_AS(ViewTracer(context, tiled, mirrors_of({panel}, 1)), UsageError);
  ViewTracer tiles(context, tiled);
  Camera flat = camera;
  flat.model = CameraModel::kOrthographic;
  CHECK_THROWS_AS(tiles.forward(gaussians, flat), UsageError);
  tracer.forward(gaussians, camera);
  CHECK_THROWS_AS(tracer.backward(gaussians, gradient, out), UsageError);
  CHECK(tracer.capped_rays() == 0);
  // Many small changes: the tree is refitted most of the times.
  CounterRng rng(95, 1);
  for (int round = 0; round < 40; ++round) {
    for (float& x : model.means) x += static_cast<float>(0.01 * rng.normal());
    gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
    tracer.forward(gaussians, camera, true);
  }
  ViewTracer fresh(context, {});
  fresh.forward(gaussians, camera);
  CHECK(fresh.download_image().data == tracer.download_image().data);

  // The same count with other parameters is another model.
  tracer.backward(gaussians, gradient, out);
  gaussians.opacities.fill(0);
  gaussians.changed(context);
  CHECK_THROWS_AS(tracer.backward(gaussians, gradient, out), UsageError);
  Camera pinhole = camera;
  pinhole.model = CameraModel::kPinhole;
  tracer.forward(gaussians, pinhole, true);
  gaussians.changed(context);
  CHECK_THROWS_AS(tracer.backward(gaussians, gradient, out), UsageError);
  tracer.forward(gaussians, pinhole, true);
  Buffer<float> small(context, 8, "small");
  CHECK_THROWS_AS(tracer.backward(gaussians, small, out), UsageError);
  CHECK_NOTHROW(tracer.backward(gaussians, gradient, out));
}

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
    const Camera camera = view_of(CameraModel::kPinhole, 120, 90, 100);
    tracer.forward(gaussians, camera);
    const Image packets = tracer.download_image();
    const Image packet_depth = tracer.download_depth();
    tracer.forward_rays(gaussians, camera);
    const Image rays = tracer.download_image();
    const Image ray_depth = tracer.download_depth();
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
        double worst = std::abs(static_cast<double>(image.data[4 * i + 3]) - expected.alpha);
        for (int c = 0; c < 3; ++c) {
          worst = std::max(
              worst, std::abs(static_cast<double>(image.data[4 * i + static_cast<std::size_t>(c)]) -
                              expected.color[c]));
        }
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

TEST_CASE("cameras that a view cannot be traced from are refused") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(20, 43, 0);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  TraceOptions options;
  ViewTracer tracer(context, options);
  Camera camera = view_of(CameraModel::kFisheye, 8, 8, 0);
  CHECK_THROWS_AS(tracer.forward(gaussians, camera), UsageError);
  camera.model = CameraModel::kEquirectangular;
  CHECK_NOTHROW(tracer.forward(gaussians, camera));
  options.traversal = Traversal::kTiles;
  ViewTracer tiles(context, options);
  CHECK_THROWS_AS(tiles.forward(gaussians, camera), UsageError);
  CHECK_THROWS_AS(tiles.forward(gaussians, view_of(CameraModel::kOrthographic, 8, 8, 9)),
                  UsageError);
  CHECK_NOTHROW(tiles.forward(gaussians, view_of(CameraModel::kPinhole, 8, 8, 9)));
}

TEST_CASE("every traversal gives the same picture, depth and near plane [small]") {
  Context context = make_test_context();
  for (const int degree : {0, 3}) {
    const Gaussians model = reference::random_scene(500, 47, degree);
    const DeviceGaussians gaussians =
        DeviceGaussians::upload(context, model, ScaleActivation::kExp);
    for (const CameraModel lens :
         {CameraModel::kPinhole, CameraModel::kOpenCv, CameraModel::kFisheye}) {
      for (const float near : {0.0f, 2.4f}) {
        CAPTURE(degree);
        CAPTURE(static_cast<int>(lens));
        CAPTURE(near);
        TraceOptions options;
        options.near_depth = near;
        options.background = {0.1f, 0.3f, 0.5f};
        options.depth = true;
        std::vector<Image> images, depths;
        for (const Traversal traversal : {Traversal::kTiles, Traversal::kBvh}) {
          options.traversal = traversal;
          ViewTracer tracer(context, options);
          tracer.forward(gaussians, view_of(lens, 64, 48, 40));
          images.push_back(tracer.download_image());
          depths.push_back(tracer.download_depth());
        }
        double mean = 0, covered = 0;
        std::size_t other = 0;
        for (std::size_t i = 0; i < images[0].pixels(); ++i) {
          float worst = 0;
          for (std::size_t c = 0; c < 4; ++c) {
            const float a = images[0].data[4 * i + c], b = images[1].data[4 * i + c];
            worst = std::max(worst, std::abs(a - b));
          }
          const float a = depths[0].data[3 * i], b = depths[1].data[3 * i];
          other += worst > 1e-3f || std::abs(a - b) > 1e-3f * std::max(a, b) ? 1 : 0;
          mean += static_cast<double>(worst);
          covered += images[0].data[4 * i + 3] > 0.5f ? 1 : 0;
        }
        const auto pixels = static_cast<double>(images[0].pixels());
        CHECK(mean / pixels < 2e-5);
        CHECK(static_cast<double>(other) * 500 < pixels);
        CHECK(covered * 10 > pixels);
      }
    }
  }
}

TEST_CASE("traversal auto is what the tuning says [small]") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(100, 48, 0);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  const Camera camera = view_of(CameraModel::kPinhole, 24, 24, 20);
  const auto picture = [&](Traversal traversal) {
    TraceOptions options;
    options.traversal = traversal;
    ViewTracer tracer(context, options);
    tracer.forward(gaussians, camera);
    return tracer.download_image().data;
  };
  const std::vector<float> tiles = picture(Traversal::kTiles), bvh = picture(Traversal::kBvh);
  REQUIRE(tiles != bvh);  // in their last bits
  CHECK(picture(Traversal::kAuto) == tiles);
  DeviceTuning tuning;
  tuning.bvh = true;
  context.set_tuning(tuning);
  CHECK(picture(Traversal::kAuto) == bvh);
}

TEST_CASE("rays that stop at the cap on hits are counted over all views that are kept") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(400, 96, 0);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  const Camera camera = fisheye_camera(90, 80);
  const Camera pinhole = reference::cube_camera(50, 40);
  TraceOptions options;
  options.max_hits = 3;
  options.memory_budget = 1 << 16;  // several batches of rays, which backward() traces again
  REQUIRE(ViewTracer::batch(options.memory_budget) < 90 * 80);
  ViewTracer tracer(context, options);
  tracer.forward(gaussians, camera);
  const std::uint64_t by_rays = tracer.capped_rays();
  tracer.forward(gaussians, pinhole);
  const std::uint64_t by_packets = tracer.capped_rays();
  CHECK(by_rays > 200);
  CHECK(by_packets > 200);
  CHECK(tracer.kept_capped_rays() == 0);
  Buffer<float> gradient(context, 4 * 90 * 80, "image gradient");
  gradient.clear();
  GaussianGradients out;
  for (std::uint64_t view = 1; view <= 3; ++view) {
    tracer.forward(gaussians, camera, true);
    tracer.backward(gaussians, gradient, out);
    CHECK(tracer.capped_rays() == by_rays);
    tracer.forward(gaussians, camera);  // of an evaluation
    tracer.forward(gaussians, pinhole, true);
    CHECK(tracer.kept_capped_rays() == view * (by_rays + by_packets));
  }
}
