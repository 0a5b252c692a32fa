// SPDX-License-Identifier: Apache-2.0
#include "trace/ray_tracer.hpp"

#include <doctest/doctest.h>

#include <cstring>
#include <glm/geometric.hpp>
#include <limits>

#include "unit/bvh/tree_forms.hpp"
#include "unit/trace/trace_fixture.hpp"

using namespace raysplats;

namespace {

std::vector<Ray> axis_rays(std::size_t count, std::uint64_t seed) {
  CounterRng rng(seed, 5);
  std::vector<Ray> rays;
  for (std::size_t i = 0; i < count; ++i) {
    const glm::dvec3 o(rng.normal(), rng.normal(), rng.normal());
    glm::dvec3 d(rng.normal(), rng.normal(), rng.normal());
    if (i % 7 == 0) d = glm::dvec3(i % 2 == 0 ? 1 : 0, i % 2, 0);  // axis-parallel
    const float t_min = i % 3 == 0 ? 0.3f : 0.0f;
    rays.push_back(
        make_ray(o, d * std::exp(rng.normal()), t_min, i % 4 == 0 ? t_min + 1.5f : kFar));
  }
  return rays;
}

void check_results(const Gaussians& model,
                   const TraceOptions& options,
                   const std::vector<Ray>& rays,
                   ColorDirection direction,
                   const std::vector<RayResult>& results,
                   const std::vector<RsCone>& cones = {}) {
  const reference::Parameters parameters(model);
  REQUIRE(results.size() == rays.size());
  double mean = 0;
  std::size_t ties = 0;
  const auto prepared = reference::prepare(parameters, options);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Ray& r = rays[i];
    reference::Cone cone;
    if (!cones.empty()) cone = {cones[i].width, cones[i].spread};
    const reference::RayTrace expected =
        reference::trace_ray(parameters, prepared, options, {r.origin[0], r.origin[1], r.origin[2]},
                             {r.direction[0], r.direction[1], r.direction[2]}, r.t_min, r.t_max,
                             direction == ColorDirection::kRay ? reference::ColorMode::kAlongRay
                                                               : reference::ColorMode::kFromOrigin,
                             cone);
    for (int c = 0; c < 3; ++c) {
      mean += std::abs(results[i].color[c] - expected.color[c]) /
              (3.0 * static_cast<double>(rays.size()));
    }
    if (expected.margin < 1e-5) {
      ++ties;
      continue;
    }
    CAPTURE(i);
    for (int c = 0; c < 3; ++c)
      CHECK(results[i].color[c] == doctest::Approx(expected.color[c]).epsilon(2e-3));
    CHECK(results[i].alpha == doctest::Approx(expected.alpha).epsilon(1e-3));
    CHECK(results[i].hits == expected.hits.size());
    CHECK((results[i].capped != 0) == expected.capped);
    CHECK(results[i].expected_depth == doctest::Approx(expected.expected_depth).epsilon(2e-3));
    CHECK(results[i].median_depth == doctest::Approx(expected.median_depth).epsilon(2e-3));
  }
  CHECK(mean < 1e-4);
  CHECK(ties * 10 < rays.size() + 10);
}

void check_rays(Context& context,
                const Gaussians& model,
                const TraceOptions& options,
                const std::vector<Ray>& rays,
                ColorDirection direction,
                const TreeForm& form = tree_form(test_device())) {
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  RayTracer tracer(context, options, form);
  tracer.update(gaussians);
  check_results(model, options, rays, direction, tracer.trace(gaussians, rays, direction));
}

// Rays as wide as the Gaussians of `model`, wider, and not at all.
void check_cones(Context& context,
                 const Gaussians& model,
                 TraceOptions options,
                 ColorDirection direction,
                 std::size_t count,
                 const TreeForm& form) {
  options.view_footprint = 0.3f;
  std::vector<Ray> rays = axis_rays(count, 4);
  std::vector<RsCone> cones;
  CounterRng rng(4, 6);
  for (std::size_t i = 0; i < count; ++i) {
    float* d = rays[i].direction;
    const float length = std::sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2]);
    for (int k = 0; k < 3; ++k) d[k] /= length;
    const auto some = [&] { return static_cast<float>(0.1 * std::exp(rng.normal())); };
    cones.push_back({i % 3 == 0 ? 0.0f : some(), i % 3 == 1 ? 0.0f : some()});
    if (i % 11 == 0) cones.back() = {0.0f, 0.0f};
  }
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  RayTracer tracer(context, options, form);
  tracer.update(gaussians);
  Buffer<Ray> device_rays(context, count, "rays");
  Buffer<RsCone> device_cones(context, count, "cones");
  Buffer<RayResult> results(context, count, "results");
  device_rays.upload(rays);
  device_cones.upload(cones);
  tracer.trace(gaussians, device_rays, count, results, direction, &device_cones);
  const std::vector<RayResult> seen = results.download();
  check_results(model, options, rays, direction, seen, cones);
  // Without cones the same tree shows Gaussians as they are.
  const std::vector<RayResult> bare = tracer.trace(gaussians, rays, direction);
  check_results(model, options, rays, direction, bare);
  std::size_t unlike = 0;
  for (std::size_t i = 0; i < count; ++i) unlike += seen[i].alpha != bare[i].alpha ? 1 : 0;
  CHECK(5 * unlike > count);
}

}  // namespace

TEST_CASE("cones equal the double reference, in every tree") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(400, 37, 2);
  for (const TreeForm& form : test::kTreeForms) {
    for (const HitOrder order : {HitOrder::kEntry, HitOrder::kPeak}) {
      for (const ColorDirection direction : {ColorDirection::kRay, ColorDirection::kFromOrigin}) {
        CAPTURE(form);
        CAPTURE(static_cast<int>(order));
        TraceOptions options;
        options.hit_order = order;
        options.adaptive_radius = (order == HitOrder::kPeak) == (direction == ColorDirection::kRay);
        check_cones(context, model, options, direction, 200, form);
      }
    }
  }
}

TEST_CASE("a few cones equal the double reference [tiny]") {
  Context context = make_test_context();
  check_cones(context, reference::random_scene(40, 38, 1), peak_order(), ColorDirection::kRay, 24,
              tree_form(test_device()));
}

TEST_CASE("cones are refused without a footprint, and where they are too few") {
  Context context = make_test_context();
  const DeviceGaussians gaussians =
      DeviceGaussians::upload(context, reference::random_scene(3, 1, 0), ScaleActivation::kExp);
  TraceOptions options;
  const Buffer<Ray> rays(context, 2, "rays");
  const Buffer<RsCone> cones(context, 1, "cones");
  Buffer<RayResult> results;
  for (const float footprint : {0.0f, 0.3f}) {
    options.view_footprint = footprint;
    RayTracer tracer(context, options);
    tracer.update(gaussians);
    CHECK_THROWS_AS(tracer.trace(gaussians, rays, 2, results, ColorDirection::kRay, &cones),
                    UsageError);
  }
}

TEST_CASE("arbitrary rays equal the double reference [small]") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(300, 31, 2);
  const std::vector<Ray> rays = axis_rays(200, 1);
  for (const HitOrder order : {HitOrder::kEntry, HitOrder::kPeak}) {
    for (const ColorDirection direction : {ColorDirection::kRay, ColorDirection::kFromOrigin}) {
      CAPTURE(static_cast<int>(order));
      TraceOptions options;
      options.hit_order = order;
      options.adaptive_radius = direction == ColorDirection::kRay;
      options.background = {0.2f, 0.4f, 0.6f};
      check_rays(context, model, options, rays, direction);
    }
  }
}

TEST_CASE("rays with more hits than the buffer, and capped rays") {
  Context context = make_test_context();
  Gaussians model = reference::random_scene(400, 32, 0);
  for (float& scale : model.log_scales) scale = std::log(0.5f);
  for (float& opacity : model.opacities) opacity = -4.0f;
  TraceOptions options;
  options.min_transmittance = 1e-6f;
  check_rays(context, model, options, axis_rays(60, 2), ColorDirection::kRay);
  options.max_hits = 70;
  check_rays(context, model, options, axis_rays(60, 3), ColorDirection::kRay);
}

TEST_CASE("camera rays and arbitrary rays see the same") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(2000, 33, 1);
  const Camera camera = reference::cube_camera(48, 40);
  TraceOptions options;
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  const Image image = trace_image(context, model, options, camera);
  std::vector<Ray> rays;
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const glm::dvec3 d((x + 0.5 - camera.cx) / camera.fx, (y + 0.5 - camera.cy) / camera.fy, 1.0);
      rays.push_back(make_ray(camera.center(), glm::transpose(camera.rotation) * d));
    }
  }
  RayTracer tracer(context, options);
  tracer.update(gaussians);
  const std::vector<RayResult> results = tracer.trace(gaussians, rays, ColorDirection::kFromOrigin);
  double mean = 0;
  std::size_t outliers = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    double worst = std::abs(results[i].alpha - image.data[4 * i + 3]);
    for (std::size_t c = 0; c < 3; ++c) {
      worst = std::max(worst,
                       static_cast<double>(std::abs(results[i].color[c] - image.data[4 * i + c])));
    }
    mean += worst / static_cast<double>(rays.size());
    if (worst > 2e-3) ++outliers;
  }
  CHECK(mean < 1e-4);
  CHECK(outliers <= 1);
}

TEST_CASE("no Gaussians and no rays") {
  Context context = make_test_context();
  TraceOptions options;
  options.background = {0.5f, 0.25f, 0.125f};
  const DeviceGaussians gaussians =
      DeviceGaussians::upload(context, Gaussians{}, ScaleActivation::kExp);
  RayTracer tracer(context, options);
  tracer.update(gaussians);
  CHECK(tracer.trace(gaussians, {}).empty());
  const std::vector<RayResult> result = tracer.trace(gaussians, axis_rays(3, 4));
  CHECK(result[2].color[1] == 0.25f);
  CHECK(result[2].hits == 0);
}

TEST_CASE("hits a million units away are met in the order that a naive root loses") {
  // Overlapping Gaussians in a row, two units apart, met on their near sides: at that distance the
  // textbook's root in single precision is off by hundreds of units.
  Context context = make_test_context();
  constexpr std::size_t kCount = 60;
  Gaussians model = reference::random_scene(kCount, 37, 0);
  CounterRng rng(9, 1);
  for (std::size_t i = 0; i < kCount; ++i) {
    model.means[3 * i] = static_cast<float>(6.0 * (rng.uniform() - 0.5));
    model.means[3 * i + 1] = 0.0f;
    model.means[3 * i + 2] = 1e6f + 2.0f * static_cast<float>(i * 37 % kCount);
    for (std::size_t k = 0; k < 3; ++k) model.log_scales[3 * i + k] = std::log(3.0f);
    model.opacities[i] = -1.0f;
  }
  TraceOptions options;
  options.min_transmittance = 1e-6f;
  const reference::RayTrace expected =
      reference::trace_ray(reference::Parameters(model), options, {0, 0, 0}, {0, 0, 1}, 0, 1e30,
                           reference::ColorMode::kFromOrigin);
  REQUIRE(expected.hits.size() > 30);
  for (std::size_t k = 1; k < expected.hits.size(); ++k) {
    REQUIRE(expected.hits[k].t > expected.hits[k - 1].t + 1.0);  // no near-ties
  }
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  for (const TreeForm& form : test::kTreeForms) {
    CAPTURE(form);
    RayTracer tracer(context, options, form);
    tracer.update(gaussians);
    const std::vector<Ray> ray{make_ray({0, 0, 0}, {0, 0, 1})};
    const RayResult result = tracer.trace(gaussians, ray, ColorDirection::kFromOrigin)[0];
    CHECK(result.hits == expected.hits.size());
    for (int c = 0; c < 3; ++c) CHECK(std::abs(result.color[c] - expected.color[c]) < 1e-3);
  }
  // The same ray as the only pixel of a camera.
  Camera camera;
  camera.width = camera.height = 1;
  camera.fx = camera.fy = 1e5;
  camera.cx = camera.cy = 0.5;
  for (const int width : {1, 4, 16}) {
    CAPTURE(width);
    options.packet_width = width;
    const Image image = trace_image(context, model, options, camera);
    for (std::size_t c = 0; c < 3; ++c) {
      CHECK(std::abs(image.data[c] - expected.color[static_cast<int>(c)]) < 1e-3);
    }
  }
}

TEST_CASE("a scene a million units from the origin still equals the reference") {
  Context context = make_test_context();
  Gaussians model = reference::random_scene(200, 34, 0);
  for (std::size_t i = 0; i < model.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      model.means[3 * i + k] = 1e6f + 40.0f * model.means[3 * i + k];
      model.log_scales[3 * i + k] += std::log(40.0f);
    }
  }
  TraceOptions options;
  std::vector<Ray> rays;
  CounterRng rng(3, 3);
  for (int i = 0; i < 200; ++i) {
    const glm::dvec3 o = glm::dvec3(1e6) + 200.0 * glm::normalize(glm::dvec3(
                                                       rng.normal(), rng.normal(), rng.normal()));
    const glm::dvec3 target =
        glm::dvec3(1e6) + 20.0 * glm::dvec3(rng.normal(), rng.normal(), rng.normal());
    rays.push_back(make_ray(o, target - o));
  }
  check_rays(context, model, options, rays, ColorDirection::kRay);
  // And as camera rays.
  Camera camera =
      look_at(glm::dvec3(1e6, 1e6, 1e6 - 160.0), glm::dvec3(1e6), {0, -1, 0}, 40, 40, 60);
  // The tracer reads the camera's centre as float; so must the reference.
  const Image image = trace_image(context, model, options, camera);
  const reference::Render expected =
      reference::render(reference::Parameters(model), options, camera);
  CHECK(compare(image, expected).mean < 1e-4);
  CHECK(compare(image, expected).maximum < 5e-3);
}

TEST_CASE("every vector width traces the same") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(700, 51, 1);
  const std::vector<Ray> rays = axis_rays(120, 11);
  for (const HitOrder order : {HitOrder::kEntry, HitOrder::kPeak}) {
    for (const TreeForm& form : test::kTreeForms) {
      CAPTURE(static_cast<int>(order));
      CAPTURE(form);
      TraceOptions options;
      options.hit_order = order;
      options.background = {0.3f, 0.1f, 0.2f};
      check_rays(context, model, options, rays, ColorDirection::kRay, form);
      options.adaptive_radius = true;
      check_rays(context, model, options, rays, ColorDirection::kFromOrigin, form);
    }
  }
  for (const int lanes : {1, 2, 3, 32, -4}) {
    CHECK_THROWS_AS(RayTracer(context, TraceOptions{}, TreeForm{lanes, false}), UsageError);
  }
  CHECK_THROWS_AS(RayTracer(context, TraceOptions{}, TreeForm{8, true}), UsageError);
}

TEST_CASE("counts around full blocks and full nodes") {
  Context context = make_test_context();
  for (const TreeForm& form : test::kTreeForms) {
    for (const std::size_t count : {1, 2, 3, 4, 5, 15, 16, 17, 31, 63, 65, 255, 256, 257, 1000}) {
      CAPTURE(form);
      CAPTURE(count);
      Gaussians model = reference::random_scene(count, 60 + count, 0);
      // Small counts get large Gaussians, which few rays would find.
      for (float& scale : model.log_scales) scale = std::min(scale, std::log(0.4f));
      check_rays(context, model, TraceOptions{}, axis_rays(40, count), ColorDirection::kRay, form);
    }
  }
}

TEST_CASE("opaque Gaussians stop rays where the reference stops them") {
  Context context = make_test_context();
  Gaussians model = reference::random_scene(3000, 52, 0);
  for (float& opacity : model.opacities) opacity += 4.0f;
  for (const float stop : {0.0f, 1e-4f, 0.05f, 0.5f}) {
    CAPTURE(stop);
    TraceOptions options;
    options.min_transmittance = stop;
    check_rays(context, model, options, axis_rays(150, 12), ColorDirection::kRay);
  }
}

TEST_CASE("a few hits at most") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(1500, 53, 0);
  for (const int most : {0, 1, 2, 17}) {
    CAPTURE(most);
    TraceOptions options;
    options.max_hits = most;
    check_rays(context, model, options, axis_rays(100, 13), ColorDirection::kRay);
  }
}

TEST_CASE("rays with many times more hits than there is room for") {
  Context context = make_test_context();
  Gaussians model = reference::random_scene(1500, 54, 0);
  for (float& opacity : model.opacities) opacity = -6.0f;
  // Boxes that all overlap: little can be blended before a walk ends.
  for (float& scale : model.log_scales) scale = std::log(1.2f);
  TraceOptions options;
  options.min_transmittance = 1e-6f;
  options.max_hits = 2000;
  std::vector<Ray> rays = axis_rays(24, 14);
  for (Ray& ray : rays) ray.t_max = kFar;
  std::vector<Ray> outside = rays;
  for (Ray& ray : outside) {
    const double length =
        glm::length(glm::dvec3(ray.direction[0], ray.direction[1], ray.direction[2]));
    for (int k = 0; k < 3; ++k)
      ray.origin[k] -= static_cast<float>(15.0 / length) * ray.direction[k];
  }
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  const reference::Parameters parameters(model);
  for (const HitOrder order : {HitOrder::kEntry, HitOrder::kPeak}) {
    options.hit_order = order;
    const std::vector<Ray>& all = order == HitOrder::kPeak ? rays : outside;
    for (const TreeForm& form : test::kUnlikeTreeForms) {
      RayTracer tracer(context, options, form);
      tracer.update(gaussians);
      const std::vector<RayResult> results = tracer.trace(gaussians, all);
      std::size_t crowded = 0;
      for (std::size_t i = 0; i < all.size(); ++i) {
        CAPTURE(i);
        CAPTURE(form);
        const Ray& r = all[i];
        const reference::RayTrace expected =
            reference::trace_ray(parameters, options, {r.origin[0], r.origin[1], r.origin[2]},
                                 {r.direction[0], r.direction[1], r.direction[2]}, r.t_min, r.t_max,
                                 reference::ColorMode::kAlongRay);
        // Among so many hits some neighbours, each of little weight, are within rounding.
        CHECK(std::abs(static_cast<double>(results[i].hits) -
                       static_cast<double>(expected.hits.size())) <= 2);
        crowded += expected.hits.size() > 600 ? 1 : 0;
        for (int c = 0; c < 3; ++c)
          CHECK(results[i].color[c] == doctest::Approx(expected.color[c]).epsilon(1e-3));
        CHECK(results[i].expected_depth == doctest::Approx(expected.expected_depth).epsilon(1e-3));
        CHECK(results[i].median_depth == doctest::Approx(expected.median_depth).epsilon(5e-3));
      }
      CHECK(crowded >= 8);
    }
  }
}

TEST_CASE("equal depths are blended by index, also across the room for hits") {
  Context context = make_test_context();
  // The same ellipsoid 600 times; colours tell them apart.
  Gaussians model = reference::random_scene(600, 55, 0);
  for (std::size_t i = 0; i < model.size(); ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      model.means[3 * i + k] = 0.25f * static_cast<float>(k);
      model.log_scales[3 * i + k] = std::log(0.2f + 0.1f * static_cast<float>(k));
    }
    for (std::size_t k = 0; k < 4; ++k) model.quaternions[4 * i + k] = model.quaternions[k];
    model.opacities[i] = -4.5f;
  }
  TraceOptions options;
  options.min_transmittance = 1e-9f;
  options.max_hits = 550;
  const std::vector<Ray> rays{make_ray({-3, 0.2, 0.4}, {1, 0.01, 0.02}),
                              make_ray({2, 2, 2}, {-1, -0.9, -0.8})};
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  const reference::Parameters parameters(model);
  for (const TreeForm& form : test::kTreeForms) {
    CAPTURE(form);
    RayTracer tracer(context, options, form);
    tracer.update(gaussians);
    const std::vector<RayResult> results = tracer.trace(gaussians, rays);
    for (std::size_t i = 0; i < rays.size(); ++i) {
      const Ray& r = rays[i];
      const reference::RayTrace expected =
          reference::trace_ray(parameters, options, {r.origin[0], r.origin[1], r.origin[2]},
                               {r.direction[0], r.direction[1], r.direction[2]}, r.t_min, r.t_max,
                               reference::ColorMode::kAlongRay);
      CHECK(expected.hits.size() == 550);
      CHECK(results[i].hits == 550);
      CHECK(results[i].capped == 1);
      for (int c = 0; c < 3; ++c)
        CHECK(results[i].color[c] == doctest::Approx(expected.color[c]).epsilon(1e-4));
    }
  }
}

TEST_CASE("Gaussians with NaN or infinity are never met") {
  Context context = make_test_context();
  const Gaussians good = reference::random_scene(200, 56, 0);
  Gaussians mixed = good;
  mixed.resize(260);
  for (std::size_t i = 200; i < mixed.size(); ++i) {
    const float bad = i % 2 == 0 ? std::numeric_limits<float>::quiet_NaN()
                                 : std::numeric_limits<float>::infinity();
    mixed.opacities[i] = 3.0f;
    switch (i % 5) {
      case 0:
        mixed.means[3 * i] = bad;
        break;
      case 1:
        mixed.log_scales[3 * i + 1] = bad;
        break;
      case 2:
        mixed.quaternions[4 * i + 2] = bad;
        break;
      case 3:
        for (std::size_t k = 0; k < 4; ++k) mixed.quaternions[4 * i + k] = 0.0f;
        break;
      default:
        mixed.opacities[i] = std::numeric_limits<float>::quiet_NaN();
    }
  }
  const std::vector<Ray> rays = axis_rays(100, 15);
  for (const TreeForm& form : test::kTreeForms) {
    RayTracer tracer(context, TraceOptions{}, form);
    const DeviceGaussians gaussians =
        DeviceGaussians::upload(context, mixed, ScaleActivation::kExp);
    tracer.update(gaussians);
    check_results(good, TraceOptions{}, rays, ColorDirection::kRay, tracer.trace(gaussians, rays));
  }
}

TEST_CASE("a refitted tree gives what a built one gives") {
  Context context = make_test_context();
  Gaussians model = reference::random_scene(900, 57, 0);
  DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  const std::vector<Ray> rays = axis_rays(150, 16);
  for (const TreeForm& form : test::kUnlikeTreeForms) {
    RayTracer tracer(context, TraceOptions{}, form);
    tracer.update(gaussians);
    Gaussians moved = model;
    CounterRng rng(58, 2);
    for (float& x : moved.means) x += static_cast<float>(0.2 * rng.normal());
    for (float& x : moved.log_scales) x += static_cast<float>(0.3 * rng.normal());
    for (float& x : moved.opacities) x += static_cast<float>(rng.normal());
    for (float& x : moved.quaternions) x += static_cast<float>(0.3 * rng.normal());
    for (float& x : moved.sh) x += static_cast<float>(rng.normal());
    const DeviceGaussians after = DeviceGaussians::upload(context, moved, ScaleActivation::kExp);
    tracer.refit(after);
    check_results(moved, TraceOptions{}, rays, ColorDirection::kRay, tracer.trace(after, rays));
    const DeviceGaussians fewer = DeviceGaussians::upload(
        context, reference::random_scene(899, 57, 0), ScaleActivation::kExp);
    CHECK_THROWS_AS(tracer.refit(fewer), UsageError);
    CHECK_THROWS_AS(tracer.trace(fewer, rays), UsageError);
  }
}

TEST_CASE("rays on the device, in batches of any size, give the same bits") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(2000, 59, 0);
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  RayTracer tracer(context, TraceOptions{});
  tracer.update(gaussians);
  // Large batches are traced in another order than small ones.
  const std::vector<Ray> rays = axis_rays(6000, 17);
  Buffer<Ray> buffer(context, rays.size() + 5, "rays");
  buffer.upload(rays);
  Buffer<RayResult> results;
  tracer.trace(gaussians, buffer, rays.size(), results);
  REQUIRE(results.size() == rays.size());
  const std::vector<RayResult> all = results.download();
  double hits = 0;
  for (std::size_t begin = 0; begin < rays.size(); begin += 1000) {
    const std::vector<RayResult> part =
        tracer.trace(gaussians, std::span<const Ray>(rays).subspan(begin, 1000));
    CHECK(std::memcmp(part.data(), all.data() + begin, part.size() * sizeof(RayResult)) == 0);
    for (const RayResult& result : part) hits += result.hits;
  }
  CHECK(hits > 10000);
  tracer.trace(gaussians, buffer, 0, results);
  CHECK_THROWS_AS(tracer.trace(gaussians, buffer, rays.size() + 6, results), UsageError);
}
