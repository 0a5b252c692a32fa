// SPDX-License-Identifier: Apache-2.0
#include "synth/bench_scenes.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>

#include "raysplats/error.hpp"
#include "reference/tracer.hpp"

using namespace raysplats;

namespace {

bool equal(const Gaussians& a, const Gaussians& b) {
  return a.means == b.means && a.quaternions == b.quaternions && a.log_scales == b.log_scales &&
         a.opacities == b.opacities && a.sh == b.sh;
}

bool all_finite(const std::vector<float>& values) {
  return std::all_of(values.begin(), values.end(), [](float x) { return std::isfinite(x); });
}

/// Cells of a 16^3 grid over the cube that hold at least one mean.
std::size_t occupied_cells(const Gaussians& model) {
  std::vector<char> occupied(16 * 16 * 16);
  for (std::size_t i = 0; i < model.size(); ++i) {
    std::size_t cell = 0;
    for (int k = 0; k < 3; ++k) {
      const double x = 8.0 * (model.means[3 * i + k] + 1.0);
      cell = 16 * cell + static_cast<std::size_t>(std::clamp(x, 0.0, 15.0));
    }
    occupied[cell] = 1;
  }
  return static_cast<std::size_t>(std::count(occupied.begin(), occupied.end(), 1));
}

}  // namespace

TEST_CASE("benchmark scenes are reproducible, finite and of the size asked for") {
  REQUIRE(bench_scene_names().size() == 3);
  for (const std::string& name : bench_scene_names()) {
    CAPTURE(name);
    for (int degree : {0, 3}) {
      const Gaussians model = bench_scene(name, 5000, 7, degree);
      CHECK(model.sh_degree == degree);
      CHECK(model.size() == 5000);
      CHECK(model.means.size() == 15000);
      CHECK(model.quaternions.size() == 20000);
      CHECK(model.log_scales.size() == 15000);
      CHECK(model.sh.size() == 15000u * sh_coefficients(degree));
      for (const auto* values :
           {&model.means, &model.quaternions, &model.log_scales, &model.opacities, &model.sh}) {
        CHECK(all_finite(*values));
      }
      CHECK(std::all_of(model.means.begin(), model.means.end(),
                        [](float x) { return std::abs(x) <= 1.0f; }));
      CHECK(equal(model, bench_scene(name, 5000, 7, degree)));
      CHECK_FALSE(equal(model, bench_scene(name, 5000, 8, degree)));
    }
    CHECK(bench_scene(name, 1, 0).size() == 1);
  }
}

TEST_CASE("benchmark scenes that cannot be made are refused") {
  CHECK_THROWS_AS(bench_scene("rand", 10, 0), UsageError);
  CHECK_THROWS_AS(bench_scene("random", 0, 0), UsageError);
  CHECK_THROWS_AS(bench_scene("random", 10, 0, 5), UsageError);
  CHECK_THROWS_AS(bench_scene("random", 10, 0, -1), UsageError);
}

TEST_CASE("a ray through the random benchmark scene blends about 42 Gaussians at any size") {
  TraceOptions options;
  options.min_transmittance = 1e-3f;
  for (std::size_t count : {std::size_t{3000}, std::size_t{30000}}) {
    const Gaussians model = bench_scene("random", count, 42);
    const reference::Parameters parameters(model);
    const reference::Render render = reference::render(parameters, options, bench_camera(16, 16));
    const double hits = static_cast<double>(render.hits) / static_cast<double>(render.pixels());
    CAPTURE(count);
    CHECK(hits > 36.0);
    CHECK(hits < 48.0);
  }
}

TEST_CASE("clustered Gaussians leave most of the cube empty and differ a hundredfold in size") {
  const Gaussians uniform = bench_scene("random", 20000, 3);
  const Gaussians clustered = bench_scene("clustered", 20000, 3);
  CHECK(2 * occupied_cells(clustered) < occupied_cells(uniform));
  std::vector<float> sizes = clustered.log_scales;
  std::sort(sizes.begin(), sizes.end());
  const auto at = [&](double share) {
    return sizes[static_cast<std::size_t>(share * static_cast<double>(sizes.size()))];
  };
  CHECK(at(0.99) - at(0.01) > std::log(50.0));
  CHECK(at(0.99) - at(0.01) < std::log(400.0));
}

TEST_CASE("surface Gaussians are thin across their third axis and mostly opaque") {
  const Gaussians model = bench_scene("surface", 20000, 3);
  std::size_t thin = 0;
  std::size_t opaque = 0;
  for (std::size_t i = 0; i < model.size(); ++i) {
    const float* s = model.log_scales.data() + 3 * i;
    thin += s[2] < std::min(s[0], s[1]) - std::log(4.0f) ? 1 : 0;
    opaque += model.opacities[i] > 1.0f ? 1 : 0;
  }
  CHECK(thin > model.size() * 9 / 10);
  CHECK(opaque > model.size() * 9 / 10);
}

TEST_CASE("the benchmark camera sees exactly the front face of the cube") {
  const Camera camera = bench_camera(800, 600);
  CHECK(camera.center().z == doctest::Approx(-4.0));
  for (double corner : {-1.0, 1.0}) {
    const glm::dvec3 point =
        camera.rotation * glm::dvec3(corner, corner, -1.0) + camera.translation;
    CHECK(camera.fx * point.x / point.z + camera.cx == doctest::Approx(400.0 * (1.0 + corner)));
    CHECK(camera.fy * point.y / point.z + camera.cy == doctest::Approx(300.0 * (1.0 + corner)));
  }
}

TEST_CASE("incoherent benchmark rays start outside the cube, cross it and are reproducible") {
  const auto rays = bench_rays(2000, 5);
  const auto again = bench_rays(2000, 5);
  REQUIRE(rays.size() == 2000);
  glm::dvec3 sum(0.0);
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const Ray& ray = rays[i];
    double length = 0.0, farthest = 0.0, middle = 0.0;
    for (int k = 0; k < 3; ++k) {
      length += double(ray.direction[k]) * ray.direction[k];
      farthest = std::max(farthest, double(std::abs(ray.origin[k])));
      middle = std::max(middle, std::abs(double(ray.origin[k]) + 4.0 * ray.direction[k]));
      sum[k] += ray.direction[k];
      CHECK(ray.origin[k] == again[i].origin[k]);
      CHECK(ray.direction[k] == again[i].direction[k]);
    }
    CHECK(length == doctest::Approx(1.0).epsilon(1e-6));
    CHECK(farthest > 1.0);
    CHECK(middle <= 1.0 + 1e-5);
    CHECK(ray.t_min == 0.0f);
    CHECK(ray.t_max > 8.0f);
  }
  // Directions of no preference: the mean of 2000 unit vectors is about 1/45 long.
  CHECK(std::sqrt(sum.x * sum.x + sum.y * sum.y + sum.z * sum.z) / 2000.0 < 0.07);
}
