// SPDX-License-Identifier: Apache-2.0
#include "reference/light.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <vector>

#include "raysplats/error.hpp"
#include "reference/light_scenes.hpp"
#include "reference/scenes.hpp"
#include "util/rng.hpp"

using namespace raysplats;
using namespace raysplats::reference;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Black surroundings, no ambient light, nothing stops early.
Scene plain_scene() {
  Scene scene;
  scene.render.ambient = {0, 0, 0};
  scene.render.min_throughput = 0.0f;
  scene.trace.min_transmittance = 0.0f;
  return scene;
}

/// Parts of a bent ray blended front to back, without background.
RayTrace composed(const std::vector<RayTrace>& parts) {
  RayTrace out;
  for (const RayTrace& part : parts) {
    out.color += out.transmittance * part.color;
    out.transmittance *= part.transmittance;
  }
  out.alpha = 1.0 - out.transmittance;
  return out;
}

void check_color(const glm::dvec3& color, const glm::dvec3& expected, double tolerance) {
  for (int c = 0; c < 3; ++c) CHECK(std::abs(color[c] - expected[c]) <= tolerance);
}

struct TestRay {
  glm::dvec3 origin, direction;
};

/// From around (0, 0, -4) at the cube [-1, 1]^3.
std::vector<TestRay> rays_at_cube(std::size_t count, std::uint64_t seed) {
  CounterRng rng(seed, 9);
  const auto around = [&](double size) {
    return size * (glm::dvec3(rng.uniform(), rng.uniform(), rng.uniform()) - 0.5);
  };
  std::vector<TestRay> out;
  for (std::size_t i = 0; i < count; ++i) {
    const glm::dvec3 origin = glm::dvec3(0, 0, -4) + around(1.0);
    out.push_back({origin, glm::normalize(around(1.6) - origin)});
  }
  return out;
}

}  // namespace

TEST_CASE("without meshes a path is a ray before the environment") {
  Scene scene = plain_scene();
  scene.gaussians = random_scene(60, 1, 2);
  scene.environment.color = {0.2f, 0.5f, 0.9f};
  scene.trace.background = {9, 9, 9};  // has no meaning here
  TraceOptions options = scene.trace;
  options.background = scene.environment.color;
  for (const TestRay& ray : rays_at_cube(20, 1)) {
    const LightPath path = trace_light(scene, ray.origin, 3.0 * ray.direction);
    const RayTrace expected = trace_ray(Parameters(scene.gaussians), options, ray.origin,
                                        ray.direction, 0.0, kInfinity, ColorMode::kAlongRay);
    check_color(path.color, expected.color, 1e-13);
    CHECK(path.alpha == doctest::Approx(expected.alpha).epsilon(1e-13));
    CHECK(path.margin <= expected.margin * (1.0 + 1e-9));
  }
}

TEST_CASE("a mirror shows what the mirrored camera sees") {
  for (const HitOrder order : {HitOrder::kEntry, HitOrder::kPeak}) {
    Scene scene = plain_scene();
    scene.trace.hit_order = order;
    scene.materials = {white(Material::Kind::kMirror)};
    scene.meshes = {rectangle({0, 0, 2}, {20, 0, 0}, {0, 20, 0}, 0)};
    scene.environment.color = {0.3f, 0.2f, 0.1f};
    TraceOptions options = scene.trace;
    options.background = scene.environment.color;
    CounterRng rng(5, 1);

    // Nothing straddles the mirror and the way to it is free: equal as a whole.
    scene.gaussians = gaussian_cloud(80, 3, {2, -1, -1}, {4, 1, 1}, 0.12, 2);
    double seen = 0.0;
    for (int i = 0; i < 40; ++i) {
      const glm::dvec3 origin(-3, 0, 0);
      const glm::dvec3 target(3.0 + 1.6 * (rng.uniform() - 0.5), 1.6 * (rng.uniform() - 0.5), 4.0);
      const glm::dvec3 d = glm::normalize(target - origin);
      const LightPath path = trace_light(scene, origin, d);
      const RayTrace expected = trace_ray(Parameters(scene.gaussians), options, {-3, 0, 4},
                                          {d.x, d.y, -d.z}, 0.0, kInfinity, ColorMode::kAlongRay);
      check_color(path.color, expected.color, 1e-12);
      CHECK(path.alpha == doctest::Approx(expected.alpha).epsilon(1e-12));
      seen += path.alpha / 40.0;
    }
    CHECK(seen > 0.4);

    // Straddling ones are cut by their keys: the direct ray takes those up to the mirror, the
    // mirrored camera's ray those behind it.
    options.background = {0, 0, 0};
    scene.gaussians = gaussian_cloud(80, 4, {-1, -1, 0}, {1, 1, 3}, 0.2, 2);
    const Parameters parameters(scene.gaussians);
    int straddling = 0;
    for (const TestRay& ray : rays_at_cube(40, 2)) {
      const glm::dvec3& d = ray.direction;
      const double t = (2.0 - ray.origin.z) / d.z;
      const glm::dvec3 mirrored(ray.origin.x, ray.origin.y, 4.0 - ray.origin.z);
      const RayTrace direct =
          trace_ray(parameters, options, ray.origin, d, 0.0, t, ColorMode::kAlongRay);
      const RayTrace behind = trace_ray(parameters, options, mirrored, {d.x, d.y, -d.z}, t,
                                        kInfinity, ColorMode::kAlongRay);
      const LightPath path = trace_light(scene, ray.origin, d);
      const RayTrace both = composed({direct, behind});
      const glm::dvec3 environment(0.3f, 0.2f, 0.1f);
      check_color(path.color, both.color + both.transmittance * environment, 1e-12);
      for (const Hit& hit : direct.hits) {
        if (scene.gaussians.means[3 * hit.index + 2] > 2.0f) ++straddling;
      }
    }
    if (order == HitOrder::kEntry) CHECK(straddling > 10);
  }
}

TEST_CASE("two half-plane mirrors compose") {
  Scene scene = plain_scene();
  Material tinted = white(Material::Kind::kMirror);
  tinted.color = {0.5f, 1.0f, 0.25f};
  scene.materials = {white(Material::Kind::kMirror), tinted};
  // z = 2 for x < 1 and x = 1 for z < 2.
  scene.meshes = {rectangle({-9, 0, 2}, {10, 0, 0}, {0, 20, 0}, 0),
                  rectangle({1, 0, -8}, {0, 0, 10}, {0, 20, 0}, 1)};
  scene.gaussians = gaussian_cloud(80, 6, {-2, -1, -1}, {0.9, 1, 1.9}, 0.15, 1);
  const Parameters parameters(scene.gaussians);
  int first_z = 0, first_x = 0;
  CounterRng rng(8, 2);
  for (int i = 0; i < 40; ++i) {
    const glm::dvec3 o(-2.0, 0.2, -2.0);
    const glm::dvec3 corner(1.0, 0.4 * (rng.uniform() - 0.5), 2.0);
    const glm::dvec3 d = glm::normalize(corner + glm::dvec3(rng.uniform() - 0.5, 0, 0) - o);
    const double tz = (2.0 - o.z) / d.z;
    const double tx = (1.0 - o.x) / d.x;
    const bool z_first = tz < tx;
    (z_first ? first_z : first_x) += 1;
    const glm::dvec3 o1 =
        z_first ? glm::dvec3(o.x, o.y, 4.0 - o.z) : glm::dvec3(2.0 - o.x, o.y, o.z);
    const glm::dvec3 d1 = z_first ? glm::dvec3(d.x, d.y, -d.z) : glm::dvec3(-d.x, d.y, d.z);
    const double t1 = std::min(tz, tx), t2 = std::max(tz, tx);
    const RayTrace a = trace_ray(parameters, scene.trace, o, d, 0.0, t1, ColorMode::kAlongRay);
    const RayTrace b = trace_ray(parameters, scene.trace, o1, d1, t1, t2, ColorMode::kAlongRay);
    const RayTrace c = trace_ray(parameters, scene.trace, {2.0 - o.x, o.y, 4.0 - o.z},
                                 {-d.x, d.y, -d.z}, t2, kInfinity, ColorMode::kAlongRay);
    const glm::dvec3 tint(0.5, 1.0, 0.25);
    const glm::dvec3 expected =
        a.color + a.transmittance * ((z_first ? glm::dvec3(1.0) : tint) * b.color +
                                     tint * b.transmittance * c.color);
    check_color(trace_light(scene, o, d).color, expected, 1e-12);
  }
  CHECK(first_z > 5);
  CHECK(first_x > 5);
}

TEST_CASE("an opaque mesh hides exactly the Gaussians behind it") {
  Scene scene = plain_scene();
  scene.environment.color = {1, 1, 1};
  Material black;
  black.kind = Material::Kind::kEmissive;
  scene.materials = {black};
  scene.meshes = {rectangle({0, 0, 0}, {3, 0, 0.5}, {0, 3, -0.2}, 0)};
  scene.gaussians = random_scene(100, 11, 1);
  const Parameters parameters(scene.gaussians);
  const Triangle wall = triangles_of(scene.meshes)[0];
  std::size_t hidden = 0;
  for (const TestRay& ray : rays_at_cube(40, 3)) {
    const double t =
        glm::dot(wall.corners[0] - ray.origin, wall.normal) / glm::dot(ray.direction, wall.normal);
    const RayTrace all = trace_ray(parameters, scene.trace, ray.origin, ray.direction, 0.0,
                                   kInfinity, ColorMode::kAlongRay);
    glm::dvec3 expected(0.0);
    for (const Hit& hit : all.hits) {
      if (hit.t <= t) {
        expected += hit.transmittance * hit.alpha * hit.color;
      } else {
        ++hidden;
      }
    }
    const LightPath path = trace_light(scene, ray.origin, ray.direction);
    check_color(path.color, expected, 1e-13);
    CHECK(path.alpha == 1.0);
  }
  CHECK(hidden > 100);
}

TEST_CASE("splitting a ray anywhere and composing the parts changes nothing") {
  for (const HitOrder order : {HitOrder::kEntry, HitOrder::kPeak}) {
    Scene scene = plain_scene();
    scene.trace.hit_order = order;
    scene.gaussians = random_scene(60, 12, 2);
    scene.environment.color = {0.1f, 0.9f, 0.4f};
    Scene split = scene;
    Material clear = white(Material::Kind::kTransparent);
    clear.opacity = 0.0f;
    Material air = white(Material::Kind::kGlass);
    air.ior = 1.0f;
    split.materials = {clear, air};
    split.render.max_bounces = 100;
    CounterRng rng(2, 7);
    for (int i = 0; i < 12; ++i) {
      const glm::dvec3 center(0, 0, 2.0 * rng.uniform() - 1.0);
      const glm::dvec3 u(8, rng.normal(), rng.normal()), v(rng.normal(), 8, rng.normal());
      split.meshes.push_back(rectangle(center, u, v, static_cast<std::uint32_t>(i % 2)));
    }
    for (const TestRay& ray : rays_at_cube(30, 4)) {
      const LightPath whole = trace_light(scene, ray.origin, ray.direction);
      const LightPath parts = trace_light(split, ray.origin, ray.direction);
      REQUIRE(parts.segments.size() == 13);
      check_color(parts.color, whole.color, 1e-13);
      CHECK(parts.alpha == doctest::Approx(whole.alpha).epsilon(1e-13));
    }
  }
}

TEST_CASE("a transparent surface shows its share and lets the rest through") {
  Scene scene = plain_scene();
  scene.render.ambient = {0.5f, 0.5f, 0.5f};
  Material veil;
  veil.kind = Material::Kind::kTransparent;
  veil.color = {1.0f, 0.5f, 0.0f};
  veil.opacity = 0.3f;
  veil.emission = {0.25f, 0, 0};
  scene.materials = {veil};
  scene.meshes = {rectangle({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 0)};
  scene.environment.color = {1, 1, 1};
  const LightPath path = trace_light(scene, {0.1, 0.2, -3}, {0, 0, 1});
  // The environment lights it too.
  check_color(path.color,
              glm::dvec3(0.25, 0, 0) + 0.3 * 1.5 * glm::dvec3(1.0, 0.5, 0.0) + glm::dvec3(0.7),
              1e-7);
  CHECK(path.alpha == doctest::Approx(0.3).epsilon(1e-6));
}

TEST_CASE("paths end after max_bounces surfaces and below min_throughput") {
  Scene scene = plain_scene();
  Material mirror = white(Material::Kind::kMirror);
  mirror.color = {0.5f, 0.25f, 0.125f};
  mirror.emission = {1, 1, 1};
  scene.materials = {mirror};
  scene.meshes = {rectangle({0, 0, 0}, {9, 0, 0}, {0, 9, 0}, 0),
                  rectangle({0, 0, 1}, {9, 0, 0}, {0, 9, 0}, 0)};
  const glm::dvec3 origin(0.1, 0.2, 0.5), direction(0, 0.01, 1);
  for (const int bounces : {1, 2, 5}) {
    scene.render.max_bounces = bounces;
    const LightPath path = trace_light(scene, origin, direction);
    CHECK(path.segments.size() == static_cast<std::size_t>(bounces));
    CHECK(path.color.r == doctest::Approx(2.0 - std::pow(0.5, bounces - 1)).epsilon(1e-12));
    CHECK(path.alpha == 1.0);
  }
  scene.render.max_bounces = 50;
  scene.render.min_throughput = 0.1f;
  // 1, 1/2, 1/4, 1/8 in the strongest component; 1/16 does not go on.
  CHECK(trace_light(scene, origin, direction).segments.size() == 4);
}

TEST_CASE("a margin is small near edges and silhouettes") {
  Scene scene = plain_scene();
  scene.materials = {white(Material::Kind::kEmissive)};
  scene.meshes = {rectangle({0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 0)};
  const auto margin = [&](double x, double y) {
    return trace_light(scene, {x, y, -2}, {0, 0, 1}).margin;
  };
  CHECK(margin(0.3, 0.5) > 1e-2);
  CHECK(margin(0.3, 1.0 - 1e-7) < 1e-6);
  CHECK(margin(0.3, 1.0 + 1e-7) < 1e-6);
  CHECK(margin(0.3, 1.5) > 1e-2);
}

TEST_CASE("a picture has a ray through every pixel's centre") {
  Scene scene = plain_scene();
  scene.materials = {white(Material::Kind::kEmissive)};
  scene.materials[0].emission = {1, 2, 3};
  scene.meshes = {ball({0, 0, 0}, 0.8, 6, 0, true)};
  scene.gaussians = random_scene(20, 2, 0);
  const Camera camera = cube_camera(6, 4);
  const LightRender image = render_light(scene, camera);
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 6; ++column) {
      const auto pixel = static_cast<std::size_t>(row * 6 + column);
      const LightPath path =
          trace_light(scene, {0, 0, -4}, {(column + 0.5 - 3) / 9, (row + 0.5 - 2) / 9, 1});
      for (std::size_t c = 0; c < 3; ++c) {
        CHECK(image.image[c * 24 + pixel] == path.color[static_cast<int>(c)]);
      }
      CHECK(image.image[3 * 24 + pixel] == path.alpha);
    }
  }
  scene.render.indirect = true;
  CHECK_THROWS_AS(render_light(scene, camera), UsageError);
}
