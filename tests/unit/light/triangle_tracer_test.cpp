// SPDX-License-Identifier: Apache-2.0
#include "light/triangle_tracer.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include "raysplats/error.hpp"
#include "reference/light_scenes.hpp"
#include "reference/triangles.hpp"
#include "unit/bvh/tree_forms.hpp"
#include "unit/trace/trace_fixture.hpp"
#include "util/rng.hpp"

using namespace raysplats;
using reference::Triangle;

namespace {

glm::dvec3 origin_of(const Ray& ray) { return {ray.origin[0], ray.origin[1], ray.origin[2]}; }
glm::dvec3 direction_of(const Ray& ray) {
  return {ray.direction[0], ray.direction[1], ray.direction[2]};
}

/// Triangles of many sizes anywhere in the cube [-1, 1]^3.
Mesh triangle_soup(std::size_t count, std::uint64_t seed, double size) {
  CounterRng rng(seed, 1);
  Mesh mesh;
  for (std::size_t i = 0; i < count; ++i) {
    const glm::dvec3 center(2 * rng.uniform() - 1, 2 * rng.uniform() - 1, 2 * rng.uniform() - 1);
    const double s = size * std::exp(0.7 * rng.normal());
    for (std::uint32_t k = 0; k < 3; ++k) {
      for (int axis = 0; axis < 3; ++axis) {
        mesh.positions.push_back(static_cast<float>(center[axis] + s * rng.normal()));
      }
      mesh.triangles.push_back(static_cast<std::uint32_t>(3 * i) + k);
    }
    mesh.materials.push_back(0);
  }
  return mesh;
}

std::vector<Ray> axis_rays(std::size_t count, std::uint64_t seed) {
  CounterRng rng(seed, 2);
  std::vector<Ray> rays;
  rays.reserve(count);
  for (std::size_t i = 0; i < count; ++i) {
    const glm::dvec3 o(rng.normal(), rng.normal(), rng.normal());
    glm::dvec3 d(rng.normal(), rng.normal(), rng.normal());
    if (i % 7 == 0) d = glm::dvec3(i % 2 == 0 ? 1 : 0, i % 2, 0);  // axis-parallel
    if (i % 11 == 0) d = -d;
    const float t_min = i % 3 == 0 ? 0.3f : 0.0f;
    rays.push_back(
        make_ray(o, d * std::exp(rng.normal()), t_min, i % 5 == 0 ? t_min + 1.0f : kFar));
  }
  return rays;
}

std::vector<RsSurfaceHit> trace(Context& context,
                                TriangleTracer& tracer,
                                const std::vector<Ray>& rays) {
  Buffer<Ray> device_rays(context, rays.size(), "rays");
  device_rays.upload(rays);
  Buffer<RsSurfaceHit> hits(context, rays.size(), "hits");
  tracer.nearest(device_rays, rays.size(), hits);
  return hits.download();
}

struct Agreement {
  std::size_t hits = 0;       ///< of the reference
  std::size_t ties = 0;       ///< rays with a decision that single precision may take otherwise
  std::size_t different = 0;  ///< other rays with another triangle
  double t_error = 0.0;       ///< largest |t - t'| |cos| / (|o| + t |d|) |d|
  double weight_error = 0.0;  ///< largest of a corner's weight, of triangles seen not too flat
};

void merge(Agreement& a, const Agreement& b) {
  a.hits += b.hits;
  a.ties += b.ties;
  a.different += b.different;
  a.t_error = std::max(a.t_error, b.t_error);
  a.weight_error = std::max(a.weight_error, b.weight_error);
}

Agreement compare_some(const std::vector<Triangle>& triangles,
                       const std::vector<Ray>& rays,
                       const std::vector<RsSurfaceHit>& hits,
                       std::size_t begin,
                       std::size_t end) {
  Agreement out;
  for (std::size_t i = begin; i < end; ++i) {
    const glm::dvec3 o = origin_of(rays[i]), d = direction_of(rays[i]);
    double margin = 1.0;
    reference::TriangleHit expected =
        reference::nearest_triangle(triangles, o, d, rays[i].t_min, -1, margin);
    if (rays[i].t_max < kFar) {
      margin = std::min(margin, std::abs(expected.t - rays[i].t_max));
      if (expected.t > rays[i].t_max) expected.triangle = -1;
    }
    out.hits += expected.triangle >= 0 ? 1 : 0;
    if (margin < 1e-5) {
      ++out.ties;
    } else if (hits[i].triangle != expected.triangle) {
      ++out.different;
    } else if (expected.triangle >= 0) {
      const double speed = glm::length(d);
      const double cosine = std::abs(
          glm::dot(d, triangles[static_cast<std::size_t>(expected.triangle)].normal) / speed);
      const double error = std::abs(hits[i].t - expected.t) * speed * cosine /
                           (1.0 + glm::length(o) + expected.t * speed);
      out.t_error = std::max(out.t_error, error);
      if (cosine < 0.1) continue;
      out.weight_error = std::max({out.weight_error, std::abs(hits[i].u - expected.weights.y),
                                   std::abs(hits[i].v - expected.weights.z)});
    }
  }
  return out;
}

/// Brute force in double precision on two threads.
Agreement compare_all(const std::vector<Triangle>& triangles,
                      const std::vector<Ray>& rays,
                      const std::vector<RsSurfaceHit>& hits) {
  const std::size_t half = rays.size() / 2;
  Agreement first, second;
  std::thread other([&] { first = compare_some(triangles, rays, hits, 0, half); });
  second = compare_some(triangles, rays, hits, half, rays.size());
  other.join();
  merge(first, second);
  return first;
}

void check_against_brute_force(Context& context,
                               const std::vector<Mesh>& meshes,
                               const std::vector<Ray>& rays,
                               const TreeForm& form = tree_form(test_device())) {
  TriangleTracer tracer(context, form);
  tracer.build(meshes);
  const std::vector<Triangle> triangles = reference::triangles_of(meshes);
  REQUIRE(tracer.size() == triangles.size());
  const Agreement a = compare_all(triangles, rays, trace(context, tracer, rays));
  MESSAGE(rays.size(), " rays, ", triangles.size(), " triangles: ", a.hits, " hits, ", a.ties,
          " ties, t within ", a.t_error, ", weights within ", a.weight_error);
  CHECK(a.different == 0);
  CHECK(a.hits * 10 > rays.size());
  CHECK(a.ties * 200 < rays.size() + 1000);
  CHECK(a.t_error < 2e-6);
  CHECK(a.weight_error < 1e-3);
}

}  // namespace

TEST_CASE("a million rays meet the triangles that brute force finds") {
  Context context = make_test_context();
  check_against_brute_force(context, {triangle_soup(16, 1, 0.5)}, axis_rays(1000000, 1));
}

TEST_CASE("every width of the tree finds the same [small]") {
  Context context = make_test_context();
  for (const TreeForm& form : test::kTreeForms) {
    CAPTURE(form);
    check_against_brute_force(context,
                              {triangle_soup(700, 2, 0.08), triangle_soup(333, 3, 0.05),
                               reference::ball({0.2, 0.1, 0}, 0.7, 9, 0, false)},
                              axis_rays(4000, 2), form);
  }
}

TEST_CASE("a few triangles are met in trees of every width [tiny]") {
  Context context = make_test_context();
  for (const TreeForm& form : test::kTreeForms) {
    CAPTURE(form);
    check_against_brute_force(context, {triangle_soup(70, 4, 0.5)}, axis_rays(60, 3), form);
  }
}

TEST_CASE("trees of every depth and fill are sound") {
  Context context = make_test_context();
  for (const std::size_t count : {1, 2, 3, 15, 16, 17, 255, 256, 257, 5000}) {
    CAPTURE(count);
    TriangleTracer tracer(context);
    const std::vector<Mesh> meshes = {triangle_soup(count, 40 + count, 0.2)};
    tracer.build(meshes);
    const std::vector<Ray> rays = axis_rays(count > 1000 ? 1000 : 4000, count);
    const Agreement a =
        compare_all(reference::triangles_of(meshes), rays, trace(context, tracer, rays));
    CHECK(a.different == 0);
    CHECK(a.t_error < 2e-6);
  }
}

TEST_CASE("no ray leaves a closed mesh, through its edges and corners neither") {
  Context context = make_test_context();
  struct Body {
    Mesh mesh;
    glm::dvec3 inside;
  };
  const Body bodies[] = {
      {reference::ball({0, 0, 0}, 1, 7, 0, false), {0, 0, 0}},
      {reference::ball({31.7, -4.3, 100.9}, 0.37, 16, 0, false), {31.7, -4.3, 100.9}},
      {reference::box({-1, -1, -1}, {1, 1, 1}, 0), {0, 0, 0}},
      {reference::box({-3, 0.1, -0.01}, {900, 0.2, 0.07}, 0), {1.25, 0.15, 0.03}},
  };
  for (const Body& body : bodies) {
    const std::vector<Triangle> triangles = reference::triangles_of({body.mesh});
    CounterRng rng(7, 7);
    std::vector<Ray> rays;
    const auto aim = [&](const glm::dvec3& target) {
      // From the middle, and from a point nearer to the target, all of it rounded.
      rays.push_back(make_ray(body.inside, target - body.inside));
      const glm::dvec3 nearer = body.inside + 0.5 * rng.uniform() * (target - body.inside);
      rays.push_back(make_ray(nearer, std::exp(3 * rng.normal()) * (target - nearer)));
    };
    for (const Triangle& triangle : triangles) {
      for (std::size_t k = 0; k < 3; ++k) {
        const glm::dvec3& a = triangle.corners[k];
        const glm::dvec3& b = triangle.corners[(k + 1) % 3];
        aim(a);
        for (const double along : {0.5, 0.25, rng.uniform(), rng.uniform(), 1e-6}) {
          aim(a + along * (b - a));
        }
      }
    }
    for (const TreeForm& form : test::kTreeForms) {
      CAPTURE(form);
      TriangleTracer tracer(context, form);
      tracer.build(std::vector<Mesh>{body.mesh});
      const std::vector<RsSurfaceHit> hits = trace(context, tracer, rays);
      std::size_t escaped = 0;
      for (const RsSurfaceHit& hit : hits) escaped += hit.triangle < 0 ? 1 : 0;
      CHECK(escaped == 0);
      // And it is a triangle where the ray really passes.
      std::size_t wrong = 0;
      for (std::size_t i = 0; i < rays.size(); ++i) {
        if (hits[i].triangle < 0) continue;
        reference::TriangleHit hit;
        double distance = 0.0;
        const bool met = reference::meets(triangles[static_cast<std::size_t>(hits[i].triangle)],
                                          origin_of(rays[i]), direction_of(rays[i]), hit, distance);
        wrong += !met && distance > 1e-3 ? 1 : 0;
      }
      CHECK(wrong == 0);
    }
  }
}

TEST_CASE("rays that graze a closed mesh cross it an even number of times") {
  // Seen from outside every line through a corner or edge enters as often as it leaves; a light
  // factor of one half per triangle counts the crossings.
  Context context = make_test_context();
  const Mesh mesh = reference::ball({0.1, 0.2, 0.3}, 0.9, 8, 0, false);
  TriangleTracer tracer(context);
  tracer.build(std::vector<Mesh>{mesh});
  std::vector<Ray> rays;
  CounterRng rng(3, 3);
  for (int i = 0; i < 20000; ++i) {
    const glm::dvec3 o(rng.normal(), rng.normal(), 4.0);
    rays.push_back(make_ray(o, glm::dvec3(rng.uniform(), rng.uniform(), 0.3) - o));
  }
  Buffer<Ray> device_rays(context, rays.size(), "rays");
  device_rays.upload(rays);
  Buffer<std::int32_t> skip(context, rays.size(), "skip");
  skip.fill(~0u);
  Buffer<float> shadow(context, tracer.size(), "shadow");
  shadow.upload(std::vector<float>(tracer.size(), 0.5f));
  Buffer<float> passes(context, rays.size(), "passes");
  tracer.light_through(device_rays, skip, shadow, rays.size(), passes);
  std::size_t odd = 0, crossed = 0;
  for (const float light : passes.download()) {
    odd += light == 0.5f || light == 0.125f ? 1 : 0;
    crossed += light < 1.0f ? 1 : 0;
  }
  CHECK(odd == 0);
  CHECK(crossed > 5000);
}

TEST_CASE("light crosses a surface once where its triangles share an edge or a corner [small]") {
  // Eighths: all of the arithmetic is exact, and rays meet edges and corners as they are.
  Context context = make_test_context();
  Mesh fan;  // around the origin; every second triangle in the other sense
  fan.positions = {0, 0,  0, 1, 0,  0,  1, 1, 0,  0, 1, 0,  -1, 1,
                   0, -1, 0, 0, -1, -1, 0, 0, -1, 0, 1, -1, 0};
  for (std::uint32_t k = 1; k <= 8; ++k) {
    const std::uint32_t next = k % 8 + 1;
    fan.triangles.insert(fan.triangles.end(), {0, k % 2 == 0 ? k : next, k % 2 == 0 ? next : k});
    fan.materials.push_back(0);
  }
  std::vector<Ray> rays;
  for (const glm::dvec3 along : {glm::dvec3(0, 0, 1), glm::dvec3(0.5, 0, 1), glm::dvec3(0, -2, 1),
                                 glm::dvec3(0.25, 0.5, -1), glm::dvec3(1, 1, 0.5)}) {
    for (int x = -7; x < 8; ++x) {
      for (int y = -7; y < 8; ++y)
        rays.push_back(make_ray(glm::dvec3(x / 8.0, y / 8.0, 0) - 4.0 * along, along));
    }
  }
  for (const TreeForm& form : test::kTreeForms) {
    CAPTURE(form);
    TriangleTracer tracer(context, form);
    tracer.build(std::vector<Mesh>{fan});
    Buffer<Ray> device_rays(context, rays.size(), "rays");
    device_rays.upload(rays);
    Buffer<std::int32_t> skip(context, rays.size(), "skip");
    skip.fill(~0u);
    Buffer<float> shadow(context, tracer.size(), "shadow");
    Buffer<float> passes(context, rays.size(), "passes");
    for (const float strength : {0.25f, 1.0f}) {
      shadow.upload(std::vector<float>(tracer.size(), strength));
      tracer.light_through(device_rays, skip, shadow, rays.size(), passes);
      const std::vector<float> light = passes.download();
      CHECK(std::count(light.begin(), light.end(), 1.0f - strength) ==
            static_cast<std::ptrdiff_t>(rays.size()));
    }
  }
}

TEST_CASE("light that passes is the product over the crossed triangles [small]") {
  Context context = make_test_context();
  const std::vector<Mesh> meshes = {triangle_soup(300, 5, 0.25), triangle_soup(41, 6, 0.4)};
  std::vector<Triangle> triangles = reference::triangles_of(meshes);
  CounterRng rng(1, 1);
  std::vector<Material> materials(triangles.size());
  std::vector<float> opacities;
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    opacities.push_back(i % 5 == 0 ? 0.0f : static_cast<float>(0.6 * rng.uniform()));
    if (i % 50 == 3) opacities.back() = 1.0f;
    materials[i].shadow = opacities.back();
    triangles[i].material = i;
  }
  std::vector<Ray> rays = axis_rays(4000, 9);
  std::vector<std::int32_t> skipped;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    skipped.push_back(i % 2 == 0 ? -1 : static_cast<std::int32_t>(rng.below(triangles.size())));
    if (i % 97 == 0) rays[i].t_max = -1.0f;
  }
  for (const TreeForm& form : test::kTreeForms) {
    CAPTURE(form);
    TriangleTracer tracer(context, form);
    tracer.build(meshes);
    Buffer<Ray> device_rays(context, rays.size(), "rays");
    device_rays.upload(rays);
    Buffer<std::int32_t> skip(context, rays.size(), "skip");
    skip.upload(skipped);
    Buffer<float> shadow(context, opacities.size(), "shadow");
    shadow.upload(opacities);
    Buffer<float> passes(context, rays.size(), "passes");
    tracer.light_through(device_rays, skip, shadow, rays.size(), passes);
    const std::vector<float> light = passes.download();
    std::size_t ties = 0;
    double error = 0.0, mean = 0.0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      double margin = 1.0;
      const double expected =
          rays[i].t_max < rays[i].t_min
              ? 1.0
              : reference::triangle_transmittance(triangles, materials, origin_of(rays[i]),
                                                  direction_of(rays[i]), rays[i].t_min,
                                                  rays[i].t_max, skipped[i], margin);
      mean += expected / static_cast<double>(rays.size());
      if (margin < 1e-5) {
        ++ties;
      } else {
        error = std::max(error, std::abs(light[i] - expected));
      }
    }
    CHECK(error < 1e-5);
    CHECK(ties < 100);
    CHECK(mean > 0.1);
    CHECK(mean < 0.8);
  }
}

TEST_CASE("a path does not meet the triangle that it starts on") {
  Context context = make_test_context();
  const std::vector<Mesh> meshes = {triangle_soup(50, 8, 0.5)};
  const std::vector<Triangle> triangles = reference::triangles_of(meshes);
  TriangleTracer tracer(context);
  tracer.build(meshes);
  CounterRng rng(2, 2);
  std::vector<Ray> rays;
  std::vector<RsPath> paths;
  for (std::size_t i = 0; i < 2000; ++i) {
    const std::size_t start = rng.below(triangles.size());
    double a = rng.uniform(), b = rng.uniform();
    if (a + b > 1) a = 1 - a, b = 1 - b;
    const auto& c = triangles[start].corners;
    rays.push_back(make_ray(c[0] + a * (c[1] - c[0]) + b * (c[2] - c[0]),
                            {rng.normal(), rng.normal(), rng.normal()}));
    RsPath path{};
    path.skip = static_cast<std::int32_t>(start);
    paths.push_back(path);
  }
  Buffer<Ray> device_rays(context, rays.size(), "rays");
  device_rays.upload(rays);
  Buffer<RsPath> device_paths(context, paths.size(), "paths");
  device_paths.upload(paths);
  Buffer<RsSurfaceHit> hits(context, rays.size(), "hits");
  tracer.nearest(device_rays, device_paths, rays.size(), hits);
  const std::vector<RsSurfaceHit> found = hits.download();
  std::size_t different = 0, ties = 0, met = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    double margin = 1.0;
    const auto expected = reference::nearest_triangle(
        triangles, origin_of(rays[i]), direction_of(rays[i]), 0.0, paths[i].skip, margin);
    met += expected.triangle >= 0 ? 1 : 0;
    if (margin < 1e-5) {
      ++ties;
    } else if (found[i].triangle != expected.triangle) {
      ++different;
    }
  }
  CHECK(different == 0);
  CHECK(ties < 20);
  CHECK(met > 500);
}

TEST_CASE("degenerate triangles are never met and hide nothing [small]") {
  Context context = make_test_context();
  const Mesh sound = triangle_soup(40, 9, 0.3);
  Mesh mesh;
  std::vector<std::uint32_t> number;  // of a sound triangle in the mixed mesh
  CounterRng rng(4, 4);
  const auto add = [&](const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
    for (const glm::dvec3& p : {a, b, c}) {
      for (int k = 0; k < 3; ++k) mesh.positions.push_back(static_cast<float>(p[k]));
      mesh.triangles.push_back(static_cast<std::uint32_t>(mesh.vertex_count() - 1));
    }
    mesh.materials.push_back(0);
  };
  for (const Triangle& triangle : reference::triangles_of({sound})) {
    const glm::dvec3 p(rng.normal(), rng.normal(), rng.normal()), q(1.0, 2.0, -1.0);
    add(p, p, p);
    add(p, q, q);
    number.push_back(static_cast<std::uint32_t>(mesh.triangle_count()));
    add(triangle.corners[0], triangle.corners[1], triangle.corners[2]);
    // Three different points on a line of exact numbers.
    add({-1, 0.5, 0.25}, {0, 0.5, 0.25}, {2, 0.5, 0.25});
  }
  std::vector<Ray> rays = axis_rays(5000, 12);
  for (int i = 0; i < 500; ++i) {  // many of them through the line
    const glm::dvec3 o(rng.normal(), rng.normal(), 3);
    rays.push_back(make_ray(o, glm::dvec3(rng.uniform(), 0.5, 0.25) - o));
  }
  TriangleTracer with(context), without(context);
  with.build(std::vector<Mesh>{mesh});
  without.build(std::vector<Mesh>{sound});
  const auto mixed = trace(context, with, rays), clean = trace(context, without, rays);
  std::size_t different = 0;
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const int expected =
        clean[i].triangle < 0
            ? -1
            : static_cast<int>(number[static_cast<std::size_t>(clean[i].triangle)]);
    different += mixed[i].triangle != expected || (expected >= 0 && mixed[i].t != clean[i].t);
  }
  CHECK(different == 0);
}

TEST_CASE("long thin triangles are met where they are") {
  Context context = make_test_context();
  Mesh mesh;
  CounterRng rng(6, 6);
  for (std::uint32_t i = 0; i < 60; ++i) {
    const double y = -1 + i / 30.0;
    for (const glm::dvec3& p : {glm::dvec3(-50, y, rng.uniform()), glm::dvec3(50, y, rng.uniform()),
                                glm::dvec3(50 * rng.normal(), y + 0.02, rng.uniform())}) {
      for (int k = 0; k < 3; ++k) mesh.positions.push_back(static_cast<float>(p[k]));
      mesh.triangles.push_back(static_cast<std::uint32_t>(mesh.vertex_count() - 1));
    }
    mesh.materials.push_back(0);
  }
  TriangleTracer tracer(context);
  tracer.build(std::vector<Mesh>{mesh});
  std::vector<Ray> rays;
  for (int i = 0; i < 5000; ++i) {
    rays.push_back(make_ray({3 * rng.normal(), rng.normal(), -3},
                            {0.2 * rng.normal(), 0.05 * rng.normal(), 1}));
  }
  const Agreement a =
      compare_all(reference::triangles_of({mesh}), rays, trace(context, tracer, rays));
  CHECK(a.hits > 1000);
  CHECK(a.ties < 100);
  CHECK(a.different <= a.hits / 1000);
}

TEST_CASE("both sides of a single triangle are met, its interval is kept [small] [tiny]") {
  Context context = make_test_context();
  Mesh mesh;
  mesh.positions = {-1, -1, 2, 3, -1, 2, -1, 3, 2};
  mesh.triangles = {0, 1, 2};
  mesh.materials = {0};
  for (const TreeForm& form : test::kTreeForms) {
    TriangleTracer tracer(context, form);
    tracer.build(std::vector<Mesh>{mesh});
    const std::vector<Ray> rays = {
        make_ray({0, 0.5, 0}, {0, 0, 1}),
        make_ray({0, 0.5, 4}, {0, 0, -0.5}),
        make_ray({0, 0.5, 0}, {0, 0, -1}),              // behind
        make_ray({0, 0.5, 0}, {0, 0, 1}, 2.0f),         // t_min is outside of the interval
        make_ray({0, 0.5, 0}, {0, 0, 1}, 1.9f, 2.0f),   // t_max inside
        make_ray({0, 0.5, 0}, {0, 0, 1}, 0.0f, 1.99f),  // too short
        make_ray({3, 3, 0}, {0, 0, 1}),                 // beside
        make_ray({0, 0, 2}, {1, 0, 0}),                 // in its plane
        make_ray({0, 0.5, 0}, {0, 0, 1}, 3.0f, 1.0f),   // empty interval
    };
    const auto hits = trace(context, tracer, rays);
    const int expected[] = {0, 0, -1, -1, 0, -1, -1, -1, -1};
    for (std::size_t i = 0; i < rays.size(); ++i) {
      CAPTURE(i);
      CHECK(hits[i].triangle == expected[i]);
    }
    CHECK(hits[0].t == 2.0f);
    CHECK(hits[1].t == 4.0f);
    CHECK(hits[0].u == doctest::Approx(0.25));
    CHECK(hits[0].v == doctest::Approx(0.375));
  }
}

TEST_CASE("of coincident triangles the one with the lowest number is met") {
  Context context = make_test_context();
  Mesh mesh;
  mesh.positions = {-1, -1, 2, 3, -1, 2, -1, 3, 2, 0, 0, 5, 1, 0, 5, 0, 1, 5};
  for (int i = 0; i < 40; ++i) {
    if (i < 7) {
      mesh.triangles.insert(mesh.triangles.end(), {3, 4, 5});
    } else {
      mesh.triangles.insert(mesh.triangles.end(), {0, 1, 2});
    }
    mesh.materials.push_back(0);
  }
  for (const TreeForm& form : test::kTreeForms) {
    TriangleTracer tracer(context, form);
    tracer.build(std::vector<Mesh>{mesh});
    CHECK(trace(context, tracer, {make_ray({0.1, 0.2, 0}, {0, 0, 1})})[0].triangle == 7);
  }
}

TEST_CASE("no mesh, empty meshes and mesh numbers [small] [tiny]") {
  Context context = make_test_context();
  TriangleTracer tracer(context);
  const std::vector<Ray> rays = {make_ray({0, 0, 0}, {0, 0, 1})};
  tracer.build({});
  CHECK(tracer.size() == 0);
  CHECK(trace(context, tracer, rays)[0].triangle == -1);
  const Mesh wall = reference::rectangle({0, 0, 3}, {1, 0, 0}, {0, 1, 0}, 0);
  // Numbers run through all meshes, and a tracer can be built again.
  tracer.build(std::vector<Mesh>{triangle_soup(5, 3, 1e-3), Mesh{}, wall});
  CHECK(tracer.size() == 7);
  CHECK(trace(context, tracer, rays)[0].triangle >= 5);
  tracer.build(std::vector<Mesh>{Mesh{}});
  CHECK(trace(context, tracer, rays)[0].triangle == -1);
}

TEST_CASE("meshes with numbers that are none are refused by name") {
  Context context = make_test_context();
  TriangleTracer tracer(context);
  const auto message_of = [&](const std::vector<Mesh>& meshes) {
    try {
      tracer.build(meshes);
    } catch (const DataError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  const Mesh sound = triangle_soup(4, 1, 0.1);
  for (const float bad :
       {std::numeric_limits<float>::quiet_NaN(), std::numeric_limits<float>::infinity()}) {
    Mesh mesh = sound;
    mesh.positions[3 * 7 + 1] = bad;
    const std::string message = message_of({sound, mesh});
    CHECK(message.find("ertex 7 of mesh 1") != std::string::npos);
    CHECK(message.find("finite") != std::string::npos);
  }
  Mesh mesh = sound;
  mesh.triangles[4] = 12;
  const std::string message = message_of({mesh});
  CHECK(message.find("riangle 1 of mesh 0") != std::string::npos);
  CHECK(message.find("12") != std::string::npos);
}
