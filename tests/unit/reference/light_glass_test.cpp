// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>
#include <vector>

#include "reference/light.hpp"
#include "reference/light_scenes.hpp"
#include "reference/optics.hpp"
#include "reference/scenes.hpp"

using namespace raysplats;
using namespace raysplats::reference;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kDegree = std::numbers::pi / 180.0;

Scene plain_scene() {
  Scene scene;
  scene.render.ambient = {0, 0, 0};
  scene.render.min_throughput = 0.0f;
  scene.render.max_bounces = 60;
  scene.trace.min_transmittance = 0.0f;
  return scene;
}

/// A body between z = low and z = high that reaches far to the sides.
Mesh slab(double low, double high, std::uint32_t material) {
  return box({-50, -50, low}, {50, 50, high}, material);
}

glm::dvec3 tilted(double angle) { return {std::sin(angle), 0.0, std::cos(angle)}; }

/// Reflectance from the tangent and sine laws (Fresnel's own form).
double fresnel_by_angles(double angle, double n1, double n2) {
  const double refracted_angle = std::asin(n1 / n2 * std::sin(angle));
  const double minus = angle - refracted_angle, plus = angle + refracted_angle;
  const double s = std::sin(minus) / std::sin(plus), p = std::tan(minus) / std::tan(plus);
  return 0.5 * (s * s + p * p);
}

}  // namespace

TEST_CASE("Fresnel's reflectance has its closed forms") {
  for (const double n2 : {1.33, 1.5, 2.4}) {
    CHECK(fresnel(1.0, 1.0, n2) ==
          doctest::Approx(std::pow((n2 - 1) / (n2 + 1), 2)).epsilon(1e-13));
    CHECK(fresnel(1.0, n2, 1.0) == doctest::Approx(fresnel(1.0, 1.0, n2)).epsilon(1e-13));
    for (const double degrees : {5.0, 30.0, 45.0, 60.0, 80.0, 89.0}) {
      const double angle = degrees * kDegree;
      const double expected = fresnel_by_angles(angle, 1.0, n2);
      CHECK(fresnel(std::cos(angle), 1.0, n2) == doctest::Approx(expected).epsilon(1e-12));
      // The same from the other side at the refracted angle.
      const double inner = std::asin(std::sin(angle) / n2);
      CHECK(fresnel(std::cos(inner), n2, 1.0) == doctest::Approx(expected).epsilon(1e-9));
    }
    // At Brewster's angle one polarisation is not reflected at all.
    const double brewster = std::atan(n2);
    const double s = std::pow((n2 * n2 - 1) / (n2 * n2 + 1), 2);
    CHECK(fresnel(std::cos(brewster), 1.0, n2) == doctest::Approx(0.5 * s).epsilon(1e-12));
  }
  CHECK(fresnel(std::cos(42.0 * kDegree), 1.5, 1.0) == 1.0);
  CHECK(fresnel(0.0, 1.0, 1.5) == doctest::Approx(1.0));
}

TEST_CASE("a path splits by Fresnel's shares and Snell's law") {
  Scene scene = plain_scene();
  scene.materials = {glass(1.5f)};
  scene.meshes = {slab(1, 2, 0)};
  for (const double degrees : {0.5, 20.0, 45.0, 56.31, 75.0}) {
    const double angle = degrees * kDegree;
    const LightPath path = trace_light(scene, {0.1, 0.3, 0}, tilted(angle));
    REQUIRE(path.segments.size() > 3);
    const double expected = fresnel_by_angles(angle, 1.0, 1.5);
    int found = 0;
    for (const LightSegment& s : path.segments) {
      if (s.surfaces != 1) continue;
      ++found;
      const bool back = s.direction.z < 0;
      CHECK(s.throughput.r == doctest::Approx(back ? expected : 1.0 - expected).epsilon(1e-12));
      CHECK(glm::length(s.direction) == doctest::Approx(1.0).epsilon(1e-14));
      CHECK(s.direction.x == doctest::Approx(std::sin(angle) / (back ? 1.0 : 1.5)).epsilon(1e-12));
      CHECK(s.bodies.size() == (back ? 0 : 1));
    }
    CHECK(found == 2);
  }
}

TEST_CASE("a slab shifts rays by Snell's closed form") {
  Scene scene = plain_scene();
  scene.materials = {glass(1.5f)};
  scene.meshes = {slab(1, 1.75, 0)};
  scene.gaussians = gaussian_cloud(60, 4, {-1, -1, 2.5}, {6, 1, 4}, 0.15, 1);
  const Parameters parameters(scene.gaussians);
  scene.render.max_bounces = 3;  // no light comes back from within the slab
  double seen = 0.0;
  for (const double degrees : {0.0, 15.0, 40.0, 60.0}) {
    const double angle = degrees * kDegree;
    const glm::dvec3 origin(0.1, 0.2, 0), d = tilted(angle);
    const LightPath path = trace_light(scene, origin, d);
    const double inner = std::asin(std::sin(angle) / 1.5);
    const double shift = 0.75 * std::sin(angle - inner) / std::cos(inner);
    const glm::dvec3 sideways(std::cos(angle), 0, -std::sin(angle));
    int left = 0;
    for (const LightSegment& s : path.segments) {
      if (s.surfaces != 2 || s.direction.z < 0) continue;
      ++left;
      CHECK(glm::length(s.direction - d) < 1e-13);
      // The shift is against the side to which the ray leans.
      CHECK(glm::dot(s.origin - origin, sideways) == doctest::Approx(-shift).epsilon(1e-12));
      const double share = std::pow(1.0 - fresnel(std::cos(angle), 1.0, 1.5), 2);
      CHECK(s.throughput.g == doctest::Approx(share).epsilon(1e-12));
      // Nothing but the shifted ray is seen: the parallel reflections meet no Gaussian.
      const RayTrace shifted = trace_ray(parameters, scene.trace, origin - shift * sideways, d, 0.0,
                                         kInfinity, ColorMode::kAlongRay);
      for (int c = 0; c < 3; ++c) {
        CHECK(path.color[c] == doctest::Approx(share * shifted.color[c]).epsilon(1e-10));
      }
      seen += shifted.alpha;
    }
    CHECK(left == 1);
  }
  CHECK(seen > 0.5);
}

TEST_CASE("light is reflected totally beyond the critical angle") {
  Scene scene = plain_scene();
  scene.materials = {glass(1.5f)};
  scene.meshes = {slab(-1, 1, 0)};
  scene.environment.color = {1, 1, 1};
  scene.render.max_bounces = 4;
  const double critical = std::asin(1.0 / 1.5);
  for (const double beyond : {-0.2, -1e-6, 1e-6, 0.2}) {
    // It starts in the body, which is therefore on no stack and counts with its own index.
    const LightPath path = trace_light(scene, {0, 0.1, 0}, tilted(critical + beyond));
    int outside = 0;
    for (const LightSegment& s : path.segments) outside += s.triangle < 0 ? 1 : 0;
    if (beyond > 0) {
      CHECK(outside == 0);
      CHECK(path.color == glm::dvec3(0.0));
      CHECK(path.alpha == 1.0);
      REQUIRE(path.segments.size() == 4);
      for (const LightSegment& s : path.segments) CHECK(s.throughput == glm::dvec3(1.0));
    } else {
      CHECK(outside > 0);
      CHECK(path.color.r > 0.01);
    }
    if (std::abs(beyond) < 1e-3) CHECK(path.margin < 1e-5);
  }
}

TEST_CASE("no light is lost in clear glass and mirrors") {
  Scene scene = plain_scene();
  scene.environment.color = {1, 1, 1};
  scene.materials = {glass(1.5f), white(Material::Kind::kMirror), glass(1.3f)};
  const auto check = [&](const char* what) {
    CAPTURE(what);
    for (int i = 0; i < 12; ++i) {
      const glm::dvec3 origin(0.07 * i - 0.4, 0.05 * i - 0.3, -4);
      const LightPath path = trace_light(scene, origin, {0.02 * i, 0.01, 1});
      for (int c = 0; c < 3; ++c) CHECK(path.color[c] == doctest::Approx(1.0).epsilon(1e-9));
      CHECK(std::abs(path.alpha) < 1e-9);
    }
  };
  scene.meshes = {slab(0, 1, 0)};
  check("slab");
  scene.meshes = {ball({0, 0, 0}, 1, 10, 1, true)};
  check("mirror");
  scene.meshes = {ball({0, 0, 0}, 1, 10, 1, false), rectangle({0, 0, 3}, {5, 0, 1}, {0, 5, 0}, 1)};
  check("two mirrors");
  // Inside of a smooth ball most light leaves at each surface, so that few bounces are enough.
  scene.render.max_bounces = 14;
  scene.meshes = {ball({0, 0, 0}, 1, 12, 0, true)};
  for (int i = 0; i < 6; ++i) {
    const LightPath path = trace_light(scene, {0.05 * i, 0.03 * i, -4}, {0, 0, 1});
    CHECK(path.color.g == doctest::Approx(1.0).epsilon(1e-5));
  }
}

TEST_CASE("a slab's reflections sum to the closed form") {
  Scene scene = plain_scene();
  scene.materials = {glass(1.5f)};
  scene.meshes = {slab(0, 1, 0)};
  for (const double degrees : {0.0, 30.0, 70.0}) {
    const double angle = degrees * kDegree;
    const LightPath path = trace_light(scene, {0.1, 0.2, -1}, tilted(angle));
    double back = 0, through = 0;
    for (const LightSegment& s : path.segments) {
      if (s.triangle < 0) (s.direction.z < 0 ? back : through) += s.throughput.r;
    }
    const double f = fresnel(std::cos(angle), 1.0, 1.5);
    CHECK(back == doctest::Approx(2 * f / (1 + f)).epsilon(1e-9));
    CHECK(through == doctest::Approx((1 - f) / (1 + f)).epsilon(1e-9));
  }
}

TEST_CASE("glass of index 1 without absorption changes nothing") {
  Scene scene = plain_scene();
  scene.environment.color = {0.2f, 0.4f, 0.8f};
  scene.gaussians = random_scene(30, 8, 1);
  Scene with = scene;
  with.materials = {glass(1.0f)};
  with.meshes = {ball({0, 0, 0.4}, 0.9, 8, 0, true), box({-3, -3, 3}, {3, 3, 4}, 0)};
  int equal_bits = 0;
  const Camera camera = cube_camera(9, 9);
  const LightScene a(scene), b(with);
  for (int i = 0; i < 81; ++i) {
    const glm::dvec3 d = pixel_direction(camera, i % 9, i / 9);
    const LightPath plain = trace_light(a, {0, 0, -4}, d);
    const LightPath glazed = trace_light(b, {0, 0, -4}, d);
    CHECK(glazed.segments.size() >= 3);
    // A sum over several parts is rounded otherwise; where one part holds all, bits are equal.
    for (int c = 0; c < 3; ++c) CHECK(std::abs(plain.color[c] - glazed.color[c]) < 1e-14);
    int parts = 0;
    for (const LightSegment& s : glazed.segments) {
      const RayTrace part = trace_ray(a.parameters, a.prepared, a.options, s.origin, s.direction,
                                      s.t_start, s.t_end, ColorMode::kAlongRay);
      parts += part.hits.empty() ? 0 : 1;
    }
    if (parts > 1) continue;
    ++equal_bits;
    CHECK(plain.color == glazed.color);
    CHECK(plain.alpha == glazed.alpha);
  }
  CHECK(equal_bits > 5);
}

TEST_CASE("glass absorbs by Beer's law") {
  Scene scene = plain_scene();
  scene.environment.color = {1, 1, 1};
  Material tinted = glass(1.0f);
  tinted.absorption = {0.5f, 1.0f, 0.0f};
  scene.materials = {tinted};
  scene.meshes = {slab(1, 3, 0)};
  for (const double degrees : {0.0, 35.0, 60.0}) {
    const double length = 2.0 / std::cos(degrees * kDegree);
    const LightPath path = trace_light(scene, {0, 0.1, 0}, tilted(degrees * kDegree));
    CHECK(path.color.r == doctest::Approx(std::exp(-0.5 * length)).epsilon(1e-12));
    CHECK(path.color.g == doctest::Approx(std::exp(-1.0 * length)).epsilon(1e-12));
    CHECK(path.color.b == 1.0);
  }
  // A Gaussian inside is dimmed up to its depth.
  scene.environment.color = {0, 0, 0};
  add_gaussian(scene.gaussians, {0, 0, 2.25}, 0.1, 0.8, {1, 1, 1});
  const LightPath path = trace_light(scene, {0, 0, 0}, {0, 0, 1});
  CHECK(path.color.r == doctest::Approx(0.8 * std::exp(-0.5 * 1.25)).epsilon(1e-6));
  CHECK(path.color.b == doctest::Approx(0.8).epsilon(1e-6));
  // And a refracting slab absorbs over the refracted length.
  scene.gaussians = Gaussians{};
  scene.environment.color = {1, 1, 1};
  scene.materials[0].ior = 1.5f;
  scene.render.max_bounces = 3;
  const double angle = 50.0 * kDegree;
  const double inner = std::asin(std::sin(angle) / 1.5);
  for (const LightSegment& s : trace_light(scene, {0, 0.1, 0}, tilted(angle)).segments) {
    if (s.surfaces != 2 || s.direction.z < 0) continue;
    const double f = fresnel_by_angles(angle, 1.0, 1.5);
    CHECK(
        s.throughput.r ==
        doctest::Approx((1 - f) * (1 - f) * std::exp(-0.5 * 2.0 / std::cos(inner))).epsilon(1e-9));
  }
}

TEST_CASE("bodies of glass nest") {
  Scene scene = plain_scene();
  Material outer = glass(1.3f), inner = glass(1.7f);
  outer.absorption = {0.1f, 0, 0};
  inner.absorption = {0, 0.2f, 0};
  scene.materials = {outer, inner};
  scene.meshes = {slab(0, 4, 0), box({-40, -40, 1}, {40, 40, 2}, 1)};
  scene.render.max_bounces = 5;
  const double angle = 40.0 * kDegree;
  const LightPath path = trace_light(scene, {0.1, 0.2, -1}, tilted(angle));
  // Along the refracted path n sin(angle) stays, and the stack is 0, 01, 0.
  const double indices[5] = {1.0, 1.3f, 1.7f, 1.3f, 1.0};
  const std::vector<std::size_t> stacks[5] = {{}, {0}, {0, 1}, {0}, {}};
  int forward = 0;
  double through = 1.0;
  for (const LightSegment& s : path.segments) {
    if (s.direction.z < 0 || forward != s.surfaces) continue;
    CHECK(indices[forward] * s.direction.x == doctest::Approx(std::sin(angle)).epsilon(1e-12));
    CHECK(s.bodies == stacks[forward]);
    CHECK(s.throughput.b == doctest::Approx(through).epsilon(1e-12));
    if (forward < 4) {
      through *= 1.0 - fresnel_by_angles(std::asin(std::sin(angle) / indices[forward]),
                                         indices[forward], indices[forward + 1]);
    } else {
      CHECK(s.throughput.r / s.throughput.b ==
            doctest::Approx(
                std::exp(-0.1f * 3.0 / std::sqrt(1 - std::pow(std::sin(angle) / 1.3f, 2))))
                .epsilon(1e-10));
      CHECK(s.throughput.g / s.throughput.b ==
            doctest::Approx(
                std::exp(-0.2f * 1.0 / std::sqrt(1 - std::pow(std::sin(angle) / 1.7f, 2))))
                .epsilon(1e-10));
    }
    ++forward;
  }
  CHECK(forward == 5);

  // An inner body of the same index is not seen.
  scene.materials[1] = scene.materials[0];
  Scene without = scene;
  without.meshes.pop_back();
  scene.environment.color = without.environment.color = {1, 1, 1};
  scene.render.max_bounces = 24;
  without.render.max_bounces = 12;
  scene.materials[0].absorption = scene.materials[1].absorption = {0, 0, 0};
  without.materials = scene.materials;
  CHECK(trace_light(scene, {0.1, 0.2, -1}, tilted(angle)).color.r ==
        doctest::Approx(trace_light(without, {0.1, 0.2, -1}, tilted(angle)).color.r).epsilon(1e-9));
}

TEST_CASE("overlapping bodies are left in any order") {
  // Entered as 0, 1 and left as 0, 1: in between the second one remains.
  Scene scene = plain_scene();
  scene.materials = {glass(1.3f), glass(1.7f)};
  scene.meshes = {slab(0, 2, 0), box({-40, -40, 1}, {40, 40, 3}, 1)};
  scene.render.max_bounces = 5;
  const double angle = 40.0 * kDegree;
  const std::vector<std::size_t> stacks[5] = {{}, {0}, {0, 1}, {1}, {}};
  const double indices[5] = {1.0, 1.3f, 1.7f, 1.7f, 1.0};
  int forward = 0;
  for (const LightSegment& s : trace_light(scene, {0.1, 0.2, -1}, tilted(angle)).segments) {
    if (s.direction.z < 0 || forward != s.surfaces) continue;
    CHECK(s.bodies == stacks[forward]);
    CHECK(indices[forward] * s.direction.x == doctest::Approx(std::sin(angle)).epsilon(1e-12));
    ++forward;
  }
  CHECK(forward == 5);
}

TEST_CASE("a fifth nested body refracts but is not remembered") {
  Scene scene = plain_scene();
  for (int i = 0; i < 5; ++i) {
    scene.materials.push_back(glass(1.1f + 0.1f * static_cast<float>(i)));
    scene.meshes.push_back(slab(i, 12 - i, static_cast<std::uint32_t>(i)));
  }
  scene.render.max_bounces = 11;
  scene.render.min_throughput = 0.05f;
  int forward = 0;
  std::size_t deepest = 0;
  for (const LightSegment& s : trace_light(scene, {0.1, 0.2, -1}, tilted(0.4)).segments) {
    if (s.direction.z < 0 || forward != s.surfaces) continue;
    deepest = std::max(deepest, s.bodies.size());
    const int inside = forward <= 5 ? forward : 10 - forward;
    const double index = inside == 0 ? 1.0 : 1.1f + 0.1f * static_cast<float>(inside - 1);
    CHECK(index * s.direction.x == doctest::Approx(std::sin(0.4)).epsilon(1e-6));
    ++forward;
  }
  CHECK(forward == 11);
  CHECK(deepest == 4);
}
