// SPDX-License-Identifier: Apache-2.0
#include "synth/shapes.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <memory>
#include <vector>

#include "synth/noise.hpp"
#include "util/rng.hpp"

using namespace raysplats;
using namespace raysplats::synth;

namespace {

glm::dvec3 random_point(CounterRng& rng, double extent) {
  const double x = rng.uniform(), y = rng.uniform(), z = rng.uniform();
  return extent * (2.0 * glm::dvec3(x, y, z) - 1.0);
}

/// A solid with a membership test written independently of the intersection code.
struct Solid {
  std::unique_ptr<Shape> shape;
  std::function<bool(const glm::dvec3&)> inside;
};

double distance_to_segment(const glm::dvec3& p, const glm::dvec3& a, const glm::dvec3& b) {
  const double t = std::min(1.0, std::max(0.0, glm::dot(p - a, b - a) / glm::dot(b - a, b - a)));
  return glm::length(p - a - t * (b - a));
}

std::vector<Solid> solids() {
  std::vector<Solid> list;
  const glm::dvec3 c(0.2, -0.1, 0.3);
  list.push_back({std::make_unique<Sphere>(c, 0.4),
                  [=](const glm::dvec3& p) { return glm::length(p - c) < 0.4; }});
  list.push_back({std::make_unique<Disc>(0.6, -0.2, 0.1), [](const glm::dvec3& p) {
                    return std::hypot(p.x, p.y) < 0.6 && p.z > -0.2 && p.z < 0.1;
                  }});
  const std::vector<glm::dvec3> points{{-0.5, -0.4, 0.0}, {0.3, 0.1, 0.2}, {0.4, 0.5, -0.6}};
  list.push_back({std::make_unique<Wire>(points, 0.15), [=](const glm::dvec3& p) {
                    return distance_to_segment(p, points[0], points[1]) < 0.15 ||
                           distance_to_segment(p, points[1], points[2]) < 0.15;
                  }});
  const glm::dvec3 axis = glm::normalize(glm::dvec3(0.3, -0.5, 0.8));
  list.push_back(
      {std::make_unique<Torus>(Pose{frame_along(axis), c}, 0.4, 0.12), [=](const glm::dvec3& p) {
         const double along = glm::dot(p - c, axis);
         const double across = glm::length(p - c - along * axis);
         return std::hypot(across - 0.4, along) < 0.12;
       }});
  return list;
}

}  // namespace

TEST_CASE("rays meet solids where marching along them first enters") {
  CounterRng rng(11, 0);
  for (const Solid& solid : solids()) {
    int hits = 0;
    for (int i = 0; i < 400; ++i) {
      const glm::dvec3 origin = 2.0 * glm::normalize(random_point(rng, 1.0));
      const Ray ray{origin, glm::normalize(random_point(rng, 0.6) - origin)};
      constexpr double kStep = 2e-3;
      double first = kMiss;
      for (double t = 0.0; t < 4.0 && first == kMiss; t += kStep) {
        if (solid.inside(ray.origin + t * ray.direction)) first = t;
      }
      const double t = solid.shape->intersect(ray);
      if (first < kMiss) {
        // A grazing entry shorter than a step may come before the one that marching sees.
        CHECK(t <= first + 1e-4);
        ++hits;
      }
      if (t < kMiss) {
        const glm::dvec3 point = ray.origin + t * ray.direction;
        const glm::dvec3 normal = solid.shape->normal(point);
        CHECK(glm::length(normal) == doctest::Approx(1.0).epsilon(1e-6));
        CHECK(glm::dot(normal, ray.direction) < 1e-2);
        CHECK(solid.inside(point - 1e-3 * normal));
        CHECK_FALSE(solid.inside(point + 1e-3 * normal));
        CHECK(glm::length(point - solid.shape->bound_center()) <=
              solid.shape->bound_radius() + 1e-4);
      }
    }
    CHECK(hits > 20);
  }
}

TEST_CASE("a vase is hollow and open at the top") {
  const Vase vase(glm::dvec3(0.0), 1.0);
  const double floor = vase.intersect({{0.0, 0.0, 2.0}, {0.0, 0.0, -1.0}});
  CHECK(floor == doctest::Approx(2.5 - 0.028).epsilon(1e-3));
  const double wall = vase.intersect({{2.0, 0.0, 0.0}, {-1.0, 0.0, 0.0}});
  const double inner = vase.intersect({{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0}});
  CHECK(2.0 - wall - inner == doctest::Approx(0.028).epsilon(0.02));
  CHECK(vase.normal({2.0 - wall, 0.0, 0.0}).x > 0.8);
  CHECK(vase.normal({inner, 0.0, 0.0}).x < -0.8);
}

TEST_CASE("a leaf is met from both sides within its outline only") {
  const Leaf leaf({glm::dmat3(1.0), glm::dvec3(0.0)}, 1.0, 0.4);
  for (const double side : {1.0, -1.0}) {
    const glm::dvec3 down(0.0, 0.0, -side);
    CHECK(leaf.intersect({{0.5, 0.15, side}, down}) == doctest::Approx(1.0));
    CHECK(leaf.intersect({{0.5, 0.21, side}, down}) == kMiss);
    CHECK(leaf.intersect({{0.05, 0.15, side}, down}) == kMiss);
    CHECK(leaf.intersect({{-0.1, 0.0, side}, down}) == kMiss);
    CHECK(leaf.intersect({{0.5, 0.0, side}, -down}) == kMiss);
  }
  CHECK(leaf.intersect({{-1.0, 0.0, 0.0}, {1.0, 0.0, 0.0}}) == kMiss);
}

TEST_CASE("noise vanishes on the lattice, is smooth and depends on the seed") {
  const Noise noise(5), other(6);
  CounterRng rng(3, 0);
  double squares = 0.0, difference = 0.0;
  for (int i = 0; i < 300; ++i) {
    const glm::dvec3 p = random_point(rng, 20.0);
    CHECK(noise.gradient(glm::dvec3(std::floor(p.x), std::floor(p.y), std::floor(p.z))) == 0.0);
    CHECK(std::abs(noise.gradient(p)) <= 1.5);
    CHECK(std::abs(noise.gradient(p) - noise.gradient(p + 1e-6)) < 1e-4);
    squares += noise.gradient(p) * noise.gradient(p);
    difference += std::abs(noise.gradient(p) - other.gradient(p));
  }
  CHECK(squares / 300 > 0.01);
  CHECK(difference / 300 > 0.05);
}
