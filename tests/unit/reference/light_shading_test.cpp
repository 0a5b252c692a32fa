// SPDX-License-Identifier: Apache-2.0
#include <doctest/doctest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "reference/light.hpp"
#include "reference/light_scenes.hpp"
#include "util/rng.hpp"

using namespace raysplats;
using namespace raysplats::reference;

namespace {

constexpr double kPi = std::numbers::pi;

Scene plain_scene() {
  Scene scene;
  scene.render.ambient = {0, 0, 0};
  scene.render.min_throughput = 0.0f;
  scene.render.shadows.strength = 1.0f;
  scene.trace.min_transmittance = 0.0f;
  return scene;
}

Light point_light(const glm::vec3& position, const Rgb& color) {
  Light light;
  light.position = {position.x, position.y, position.z};
  light.color = color;
  return light;
}

/// A diffuse floor at z = 0, seen straight from z = -3 at (x, y).
Scene floor_scene() {
  Scene scene = plain_scene();
  Material material;
  material.color = {0.5f, 0.25f, 1.0f};
  scene.materials = {material};
  scene.meshes = {rectangle({0, 0, 0}, {5, 0, 0}, {0, 5, 0}, 0)};
  return scene;
}

LightPath look_down(const Scene& scene, double x = 0.1, double y = 0.2) {
  return trace_light(scene, {x, y, -3}, {0, 0, 1});
}

}  // namespace

TEST_CASE("lights fall on a diffuse surface by their closed form") {
  Scene scene = floor_scene();
  scene.lights = {point_light({1.1f, 0.2f, -2}, {4, 8, 2})};
  const double square = 1.0 + 4.0;
  const double cosine = 2.0 / std::sqrt(square);
  LightPath path = look_down(scene);
  CHECK(path.color.r == doctest::Approx(0.5 * 4 / square * cosine).epsilon(1e-6));
  CHECK(path.color.g == doctest::Approx(0.25 * 8 / square * cosine).epsilon(1e-6));
  CHECK(path.color.b == doctest::Approx(1.0 * 2 / square * cosine).epsilon(1e-6));

  // Both sides are lit alike, each from its own: from below this light does not count.
  CHECK(trace_light(scene, {0.1, 0.2, 3}, {0, 0, -1}).color == glm::dvec3(0.0));

  // A highlight of Blinn's half vector, on top of the ambient light.
  scene.materials[0].specular = 0.75f;
  scene.materials[0].roughness = 0.5f;
  scene.render.ambient = {0.1f, 0.1f, 0.1f};
  path = look_down(scene);
  const glm::dvec3 l = glm::normalize(glm::dvec3(1.0, 0, -2));
  const double lobe = std::pow(glm::normalize(l + glm::dvec3(0, 0, -1)).z, 30.0);
  CHECK(
      path.color.r ==
      doctest::Approx(0.5 * (0.1 + 4 / square * cosine) + 0.75 * 4 / square * lobe).epsilon(1e-5));

  Light sun;
  sun.kind = Light::Kind::kDirectional;
  sun.direction = {0, 3, 4};
  sun.color = {1, 1, 1};
  scene.materials[0].specular = 0.0f;
  scene.lights = {sun};
  CHECK(look_down(scene).color.r == doctest::Approx(0.5 * (0.1 + 0.8)).epsilon(1e-6));
}

TEST_CASE("a shadow is the product over triangles and Gaussians in between") {
  Scene scene = floor_scene();
  scene.lights = {point_light({0.1f, 0.2f, -6}, {36, 36, 36})};
  Material veil;
  veil.kind = Material::Kind::kTransparent;
  veil.opacity = 0.4f;
  Material blind = veil;
  blind.shadow = 0.5f;
  scene.materials.push_back(veil);
  scene.materials.push_back(blind);
  scene.materials.push_back(white(Material::Kind::kEmissive));
  // Above the eye, so that it sees the floor free: they are between floor and light alone.
  scene.meshes.push_back(rectangle({0, 0, -4}, {2, 0, 0}, {0, 2, 0}, 1));
  scene.meshes.push_back(rectangle({0, 0, -5}, {2, 0, 0}, {0, 2, 0}, 2));
  scene.meshes.push_back(rectangle({0, 0, -5.5}, {2, 0, 0}, {0, 2, 0}, 3));
  scene.meshes.push_back(rectangle({0, 0, -7}, {2, 0, 0}, {0, 2, 0}, 2));  // behind the light
  const auto shown = [&] { return look_down(scene).color.r / 0.5; };
  CHECK(shown() == doctest::Approx(0.6 * 0.5).epsilon(1e-6));
  scene.render.shadows.strength = 0.5f;
  CHECK(shown() == doctest::Approx(1.0 - 0.5 * (1.0 - 0.3)).epsilon(1e-6));
  scene.render.shadows.strength = 1.0f;

  // Gaussians: 1 - opacity exp(-d^2 / 2 sigma^2), those whose ellipsoid begins in between.
  CounterRng rng(4, 4);
  double expected = 1.0;
  int inside = 0;
  for (int i = 0; i < 40; ++i) {
    const glm::dvec3 mean(rng.uniform(), rng.uniform(), -3.6 - 3.0 * rng.uniform());
    const double sigma = 0.1 + 0.1 * rng.uniform(), opacity = 0.1 + 0.5 * rng.uniform();
    add_gaussian(scene.gaussians, mean, sigma, opacity, {1, 1, 1});
    const glm::dvec3 way = mean - glm::dvec3(0.1, 0.2, 0);
    const double square = (way.x * way.x + way.y * way.y) / (sigma * sigma);
    if (square > 11.3449) continue;
    const double begin = -way.z - sigma * std::sqrt(11.3449 - square);
    if (begin < 0 || begin > 6) continue;
    expected *= 1.0 - opacity * std::exp(-0.5 * square);
    ++inside;
  }
  CHECK(inside > 5);
  CHECK(expected < 0.8);
  scene.render.shadows.mesh_on_mesh = false;
  CHECK(shown() == doctest::Approx(expected).epsilon(1e-5));
  scene.render.shadows.mesh_on_mesh = true;
  CHECK(shown() == doctest::Approx(0.3 * expected).epsilon(1e-5));
  scene.render.shadows.gaussians_on_mesh = false;
  CHECK(shown() == doctest::Approx(0.3).epsilon(1e-6));
}

TEST_CASE("meshes and Gaussians cast shadows on Gaussians") {
  Scene scene = plain_scene();
  scene.render.bias = 0.05f;
  scene.materials = {white(Material::Kind::kDiffuse)};
  // A ball at the origin, seen along z; lights at +x and -y; a wall before the first.
  add_gaussian(scene.gaussians, {0, 0, 0}, 0.1, 0.8, {1, 1, 1});
  scene.meshes = {rectangle({1, 0, 0}, {0, 0.5, 0}, {0, 0, 0.5}, 0)};
  scene.lights = {point_light({2, 0, 0}, {4, 0, 0}), point_light({0, -1, 0}, {0, 3, 0})};
  const auto shown = [&] { return trace_light(scene, {0, 0, -2}, {0, 0, 1}).color.r / 0.8; };
  // Weights: 4 / 2^2 and 3 / 1^2.
  CHECK(shown() == doctest::Approx(0.75).epsilon(1e-6));
  scene.render.shadows.mesh_on_gaussians = false;
  CHECK(shown() == doctest::Approx(1.0).epsilon(1e-6));
  add_gaussian(scene.gaussians, {0, -0.6, 0}, 0.05, 0.5, {1, 1, 1});
  CHECK(shown() == doctest::Approx(1.0).epsilon(1e-6));
  scene.render.shadows.gaussians_on_gaussians = true;
  CHECK(shown() == doctest::Approx(0.25 + 0.75 * 0.5).epsilon(1e-6));
  scene.render.shadows.strength = 0.4f;
  CHECK(shown() == doctest::Approx(1.0 - 0.4 * 0.75 * 0.5).epsilon(1e-6));
  // Nearer than the bias nothing counts, neither Gaussians nor triangles.
  scene.render.bias = 0.9f;
  CHECK(shown() == doctest::Approx(1.0).epsilon(1e-6));
  scene.render.shadows.strength = 1.0f;
  scene.render.shadows.mesh_on_gaussians = true;
  CHECK(shown() == doctest::Approx(0.75).epsilon(1e-6));
  scene.render.bias = 1.1f;
  CHECK(shown() == doctest::Approx(1.0).epsilon(1e-6));
  // A wall that the Gaussian sticks in does not hide its own front.
  scene.render.bias = 0.01f;
  scene.render.shadows.gaussians_on_gaussians = false;
  scene.meshes = {rectangle({0, 0, -0.02}, {0.5, 0, 0}, {0, 0.5, 0}, 0)};
  scene.materials = {white(Material::Kind::kEmissive)};
  scene.materials[0].shadow = 1.0f;
  scene.lights = {point_light({0, 0, -3}, {1, 1, 1})};
  CHECK(shown() == doctest::Approx(1.0).epsilon(1e-6));
}

TEST_CASE("a sphere light's shadow is the share of its disc that is seen") {
  Scene scene = floor_scene();
  Light light = point_light({0.1f, 0.2f, -4}, {16, 16, 16});
  light.kind = Light::Kind::kSphere;
  light.radius = 0.5f;
  scene.lights = {light};
  CHECK(look_down(scene).color.r == doctest::Approx(0.5).epsilon(1e-6));
  // A half plane whose edge passes between the point and the disc's centre hides half of it.
  scene.materials.push_back(white(Material::Kind::kDiffuse));
  scene.meshes.push_back(rectangle({-0.9, 0, -3.5}, {1, 0, 0}, {0, 4, 0}, 1));
  CHECK(look_down(scene).color.r == doctest::Approx(0.25).epsilon(0.01));
  // At three quarters of the radius a circle's segment of 7.21 % remains.
  scene.meshes[1] = rectangle({0.1 - 1.0 + 0.5 * 0.75 * 0.875, 0, -3.5}, {1, 0, 0}, {0, 4, 0}, 1);
  const double segment = (std::acos(0.75) - 0.75 * std::sqrt(1 - 0.75 * 0.75)) / kPi;
  CHECK(look_down(scene).color.r == doctest::Approx(0.5 * segment).epsilon(0.15));
  scene.lights[0].radius = 0.0f;
  CHECK(look_down(scene).color.r == 0.0);
}

TEST_CASE("textures are bilinear, repeat and colour the surface") {
  Scene scene = floor_scene();
  scene.render.ambient = {1, 1, 1};
  scene.materials[0].color = {1, 1, 1};
  scene.materials[0].texture = 0;
  Image texture(4, 2, 3);
  for (int y = 0; y < 2; ++y) {
    for (int x = 0; x < 4; ++x) {
      texture.at(x, y, 0) = static_cast<float>(x);
      texture.at(x, y, 1) = static_cast<float>(y);
    }
  }
  scene.textures = {texture};
  // The rectangle's (0, 0) is at (-5, -5), a texel is 2.5 x 5.
  const auto at = [&](double column, double row) {
    return look_down(scene, -5 + 2.5 * column, -5 + 5.0 * row).color;
  };
  CHECK(at(0.5, 0.5).r == doctest::Approx(0.0));
  CHECK(at(2.5, 1.5).r == doctest::Approx(2.0));
  CHECK(at(2.5, 1.5).g == doctest::Approx(1.0));
  CHECK(at(1.75, 0.5).r == doctest::Approx(1.25).epsilon(1e-6));
  CHECK(at(3.75, 0.75).r == doctest::Approx(0.75 * 3).epsilon(1e-6));  // a quarter of the first
  CHECK(at(1.5, 0.75).g == doctest::Approx(0.25).epsilon(1e-6));
}

TEST_CASE("an environment picture stands upright around the scene") {
  Environment environment;
  environment.equirect = Image(8, 4, 3);
  environment.color = {2, 1, 1};
  environment.up = {0, -1, 0};  // the axes of a camera without rotation
  for (int y = 0; y < 4; ++y) {
    for (int x = 0; x < 8; ++x) {
      environment.equirect.at(x, y, 0) = static_cast<float>(x);
      environment.equirect.at(x, y, 1) = static_cast<float>(y);
    }
  }
  const auto seen = [&](const glm::dvec3& d) {
    return EnvironmentLight(environment).seen(glm::normalize(d));
  };
  CHECK(seen({0, 0, 1}).r == doctest::Approx(2 * 3.5));
  CHECK(seen({0, 0, 1}).g == doctest::Approx(1.5));
  CHECK(seen({1, 0, 0}).r == doctest::Approx(2 * 5.5));  // right of the centre
  CHECK(seen({-1, 0, 0}).r == doctest::Approx(2 * 1.5));
  CHECK(seen({0, 0, -1}).r == doctest::Approx(2 * 3.5));  // between the last and the first column
  CHECK(seen({0, -1, 0}).g == doctest::Approx(0.0));      // up
  CHECK(seen({0, 1, 0}).g == doctest::Approx(3.0));
  CHECK(seen({0, -1, 1}).g == doctest::Approx(0.5));
  // Turning about -y by the right hand brings +z to -x.
  environment.rotation = 90.0f;
  CHECK(seen({-1, 0, 0}).r == doctest::Approx(2 * 3.5));
  environment.rotation = 0.0f;
  environment.up = {0, 0, 1};
  CHECK(seen({1, 0, 0}).r == doctest::Approx(2 * 3.5));
  CHECK(seen({0, -1, 0}).r == doctest::Approx(2 * 5.5));
}

TEST_CASE("nine coefficients light a normal by the hemisphere's mean") {
  // Pictures of degree 0 to 2 are represented exactly: the mean over the hemisphere with the cosine
  // is found by brute force.
  Environment environment;
  environment.equirect = Image(64, 32, 3);
  environment.up = {0.2f, 0.9f, -0.3f};
  environment.rotation = 25.0f;
  CHECK(EnvironmentLight(Environment{{0.3f, 0.2f, 0.1f}, {}, {0, 1, 0}, 0.0f})
            .on_normal({0, 0, 1})
            .r == doctest::Approx(0.3f));
  for (int y = 0; y < 32; ++y) {
    const double polar = kPi * (y + 0.5) / 32;
    for (int x = 0; x < 64; ++x) {
      const double azimuth = 2 * kPi * ((x + 0.5) / 64 - 0.5);
      environment.equirect.at(x, y, 0) = 1.0f;
      environment.equirect.at(x, y, 1) = static_cast<float>(1.0 + std::cos(polar));
      environment.equirect.at(x, y, 2) =
          static_cast<float>(1.0 + std::sin(polar) * std::sin(azimuth) * std::cos(polar));
    }
  }
  const EnvironmentLight light(environment);
  CounterRng rng(3, 3);
  for (int i = 0; i < 5; ++i) {
    const glm::dvec3 n = glm::normalize(glm::dvec3(rng.normal(), rng.normal(), rng.normal()));
    glm::dvec3 sum(0.0);
    double weights = 0.0;
    for (int y = 0; y < 200; ++y) {
      for (int x = 0; x < 400; ++x) {
        const double polar = kPi * (y + 0.5) / 200, azimuth = 2 * kPi * (x + 0.5) / 400;
        const glm::dvec3 d(std::sin(polar) * std::cos(azimuth), std::sin(polar) * std::sin(azimuth),
                           std::cos(polar));
        const double weight = std::max(0.0, glm::dot(n, d)) * std::sin(polar);
        sum += weight * light.seen(d);
        weights += weight;
      }
    }
    for (int c = 0; c < 3; ++c) {
      CHECK(light.on_normal(n)[c] == doctest::Approx(sum[c] / weights).epsilon(2e-3));
    }
  }
}
