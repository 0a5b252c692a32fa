// SPDX-License-Identifier: Apache-2.0
#include "synth/backdrop.hpp"

#include <algorithm>
#include <cmath>

#include "synth/noise.hpp"
#include "util/rng.hpp"

namespace raysplats::synth {
namespace {

using glm::dvec3;

constexpr double kWall = 3.0;
constexpr double kGround = -0.80;  // just below the table
constexpr double kHills = 60.0;

dvec3 blend(const dvec3& a, const dvec3& b, double weight) {
  return a + (b - a) * std::clamp(weight, 0.0, 1.0);
}

Noise noise_of(std::uint64_t seed) { return Noise(CounterRng(seed, 4).bits()); }

dvec3 paint(const Noise& noise, const dvec3& p) {
  const double broad = 0.5 + 0.5 * noise.fractal(0.9 * p, 3);
  const double fine = 0.5 + 0.5 * noise.gradient(4.0 * p);
  const dvec3 base = blend({0.24, 0.36, 0.52}, {0.86, 0.74, 0.52}, broad);
  return blend(base, {0.62, 0.22, 0.20}, 0.8 * std::pow(fine, 3.0));
}

dvec3 sky(const Noise& noise, const dvec3& direction) {
  const double height = std::max(direction.z, 0.0);
  const dvec3 blue = blend({0.78, 0.86, 0.93}, {0.32, 0.52, 0.84}, 1.6 * height);
  const double cloud = noise.fractal(dvec3(3.0, 3.0, 6.0) * direction, 3) + 0.1;
  return blend(blue, {0.97, 0.97, 0.98}, 1.2 * cloud);
}

}  // namespace

Backdrop painted_wall(std::uint64_t seed) {
  return [noise = noise_of(seed)](const Ray& ray) {
    const double t = (kWall - ray.origin.y) / ray.direction.y;
    return t > 0 ? paint(noise, ray.origin + t * ray.direction) : dvec3(0.5);
  };
}

Backdrop papered_room(std::uint64_t seed) {
  return [noise = noise_of(seed)](const Ray& ray) {
    double t = kMiss;
    int wall = 0;
    for (int a = 0; a < 3; ++a) {
      const double side = ray.direction[a] > 0 ? kRoomSide : -kRoomSide;
      const double reach = (side - ray.origin[a]) / ray.direction[a];
      if (reach > 0 && reach < t) {
        t = reach;
        wall = a;
      }
    }
    const dvec3 p = ray.origin + t * ray.direction;
    const dvec3 paper = paint(noise, 0.8 * p);
    if (wall != 2) return paper;
    // A wooden floor and a plain ceiling.
    const double grain = 0.5 + 0.5 * std::sin(7.0 * p.x + 2.0 * noise.fractal(p, 2));
    return p.z < 0 ? blend({0.45, 0.28, 0.16}, {0.68, 0.48, 0.30}, grain)
                   : blend({0.86, 0.85, 0.82}, paper, 0.25);
  };
}

Backdrop open_country(std::uint64_t seed) {
  return [noise = noise_of(seed)](const Ray& ray) {
    const dvec3& d = ray.direction;
    const double flat = std::hypot(d.x, d.y);
    // Hills stand on a circle around the scene, as seen from its middle.
    const double ridge = 0.09 + 0.06 * noise.fractal(dvec3(d.x, d.y, 0.0) * (4.0 / flat), 3);
    const double down = d.z < 0 ? (kGround - ray.origin.z) / d.z : kMiss;
    if (down * flat < kHills) {
      const dvec3 p = ray.origin + down * d;
      const double far = down * flat / kHills;
      const double patch = 0.5 + 0.5 * noise.fractal(1.5 * p, 3);
      const dvec3 grass = blend({0.22, 0.38, 0.16}, {0.58, 0.56, 0.30}, patch);
      return blend(grass, {0.46, 0.54, 0.42}, std::sqrt(far));
    }
    if (d.z < ridge * flat) {
      const double wood = 0.5 + 0.5 * noise.fractal(12.0 * d, 3);
      return blend({0.30, 0.40, 0.44}, {0.44, 0.54, 0.52}, wood);
    }
    return sky(noise, d);
  };
}

}  // namespace raysplats::synth
