// SPDX-License-Identifier: Apache-2.0
#include "synth/noise.hpp"

#include <cmath>

namespace raysplats::synth {

namespace {

double quintic(double t) { return t * t * t * (t * (t * 6.0 - 15.0) + 10.0); }
double mix(double a, double b, double weight) { return a + (b - a) * weight; }

}  // namespace

double Noise::lattice(std::int64_t x,
                      std::int64_t y,
                      std::int64_t z,
                      const glm::dvec3& offset) const {
  std::uint64_t h = seed_ + static_cast<std::uint64_t>(x) * 0x9e3779b97f4a7c15ull +
                    static_cast<std::uint64_t>(y) * 0xc2b2ae3d27d4eb4full +
                    static_cast<std::uint64_t>(z) * 0x165667b19e3779f9ull;
  h = (h ^ (h >> 30)) * 0xbf58476d1ce4e5b9ull;
  h = (h ^ (h >> 27)) * 0x94d049bb133111ebull;
  h ^= h >> 31;
  // The twelve edge midpoints of a cube: one axis is left out, the two others carry a sign.
  const double a = (h & 1u) != 0 ? 1.0 : -1.0;
  const double b = (h & 2u) != 0 ? 1.0 : -1.0;
  switch ((h >> 2) % 3) {
    case 0:
      return a * offset.x + b * offset.y;
    case 1:
      return a * offset.y + b * offset.z;
    default:
      return a * offset.z + b * offset.x;
  }
}

double Noise::gradient(const glm::dvec3& point) const {
  const double fx = std::floor(point.x), fy = std::floor(point.y), fz = std::floor(point.z);
  const auto x = static_cast<std::int64_t>(fx);
  const auto y = static_cast<std::int64_t>(fy);
  const auto z = static_cast<std::int64_t>(fz);
  const glm::dvec3 p(point.x - fx, point.y - fy, point.z - fz);
  const double u = quintic(p.x), v = quintic(p.y), w = quintic(p.z);
  double corner[2][2][2];
  for (int k = 0; k < 2; ++k) {
    for (int j = 0; j < 2; ++j) {
      for (int i = 0; i < 2; ++i) {
        corner[k][j][i] = lattice(x + i, y + j, z + k, p - glm::dvec3(i, j, k));
      }
    }
  }
  const double front =
      mix(mix(corner[0][0][0], corner[0][0][1], u), mix(corner[0][1][0], corner[0][1][1], u), v);
  const double back =
      mix(mix(corner[1][0][0], corner[1][0][1], u), mix(corner[1][1][0], corner[1][1][1], u), v);
  return mix(front, back, w);
}

double Noise::fractal(glm::dvec3 point, int octaves) const {
  double sum = 0.0;
  double amplitude = 1.0;
  for (int octave = 0; octave < octaves; ++octave) {
    sum += amplitude * gradient(point);
    amplitude *= 0.5;
    // The shift keeps the lattices' zeros of successive octaves from lying on each other.
    point = point * 2.0 + glm::dvec3(17.3, 5.7, 31.1);
  }
  return sum;
}

}  // namespace raysplats::synth
