// SPDX-License-Identifier: Apache-2.0
#include "trace/ray_tracer.hpp"

#include <doctest/doctest.h>

#include <glm/geometric.hpp>
#include <limits>

#include "trace_fixture.hpp"

using namespace raysplats;

namespace {

constexpr float kFar = std::numeric_limits<float>::max();

Ray make_ray(const glm::dvec3& o, const glm::dvec3& d, float t_min = 0.0f, float t_max = kFar) {
  Ray ray{};
  for (int j = 0; j < 3; ++j) {
    ray.origin[j] = static_cast<float>(o[j]);
    ray.direction[j] = static_cast<float>(d[j]);
  }
  ray.t_min = t_min;
  ray.t_max = t_max;
  return ray;
}

std::vector<Ray> random_rays(std::size_t count, std::uint64_t seed) {
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

void check_rays(Context& context,
                const Gaussians& model,
                const TraceOptions& options,
                const std::vector<Ray>& rays,
                ColorDirection direction) {
  const DeviceGaussians gaussians = DeviceGaussians::upload(context, model, ScaleActivation::kExp);
  RayTracer tracer(context, options);
  tracer.update(gaussians);
  const std::vector<RayResult> results = tracer.trace(gaussians, rays, direction);
  const reference::Parameters parameters(model);
  REQUIRE(results.size() == rays.size());
  double mean = 0;
  std::size_t ties = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Ray& r = rays[i];
    const reference::RayTrace expected =
        reference::trace_ray(parameters, options, {r.origin[0], r.origin[1], r.origin[2]},
                             {r.direction[0], r.direction[1], r.direction[2]}, r.t_min, r.t_max,
                             direction == ColorDirection::kRay ? reference::ColorMode::kAlongRay
                                                               : reference::ColorMode::kFromOrigin);
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

}  // namespace

TEST_CASE("arbitrary rays equal the double reference [small]") {
  Context context = make_test_context();
  const Gaussians model = reference::random_scene(300, 31, 2);
  const std::vector<Ray> rays = random_rays(200, 1);
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
  check_rays(context, model, options, random_rays(60, 2), ColorDirection::kRay);
  options.max_hits = 70;
  check_rays(context, model, options, random_rays(60, 3), ColorDirection::kRay);
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
  const std::vector<RayResult> result = tracer.trace(gaussians, random_rays(3, 4));
  CHECK(result[2].color[1] == 0.25f);
  CHECK(result[2].hits == 0);
}

TEST_CASE(
    "a million units from the origin the Viete root keeps the order that the naive root loses") {
  // One ray through 200 small Gaussians in a row, seen from far away: float roots against double
  // ones.
  const double distance = 1e6;
  const double sigma = 3.0;
  const double quantile = 11.3449;
  CounterRng rng(9, 1);
  double worst_viete = 0;
  double worst_naive = 0;
  for (int i = 0; i < 200; ++i) {
    const double x = 6.0 * (rng.uniform() - 0.5);
    const double z = distance + 2.0 * i;
    const auto near_root = [&](auto zero, bool viete) {
      using T = decltype(zero);
      const T ox = static_cast<T>(-x / sigma), oz = static_cast<T>(-z / sigma),
              dz = static_cast<T>(1.0 / sigma);
      const T dd = dz * dz, od = oz * dz, oo = ox * ox + oz * oz, q = static_cast<T>(quantile);
      const T s = od / dd;
      const T vx = ox, vz = oz - s * dz;
      const T d2 = vx * vx + vz * vz;
      if (!viete) {
        const T discriminant = od * od - dd * (oo - q);  // the textbook form
        return static_cast<double>((-od - std::sqrt(discriminant > 0 ? discriminant : T(0))) / dd);
      }
      const T far_root = -s + std::sqrt((q - d2) / dd);
      return static_cast<double>((oo - q) / (dd * far_root));
    };
    const double exact = near_root(0.0, true);
    worst_viete = std::max(worst_viete, std::abs(near_root(0.0f, true) - exact));
    worst_naive = std::max(worst_naive, std::abs(near_root(0.0f, false) - exact));
  }
  MESSAGE("worst error of the near root at 1e6 units: Viete " << worst_viete << ", naive "
                                                              << worst_naive);
  CHECK(worst_viete < 0.5);  // a few units in the last place of 1e6
  CHECK(worst_naive > 10 * worst_viete);
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
  CHECK(compare(image, expected, 1e-4).mean < 1e-4);
  CHECK(compare(image, expected, 1e-4).maximum < 5e-3);
}
