// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>

namespace raysplats::synth {

/// Smooth random field over space: gradient noise on a hashed lattice with quintic weights
/// (Perlin, "Improving Noise", 2002), hashed so that every seed is another field.
class Noise {
 public:
  explicit Noise(std::uint64_t seed) : seed_(seed) {}

  /// About [-1, 1], feature size 1.
  double gradient(const glm::dvec3& point) const;
  /// Sum of `octaves` octaves, each of half the amplitude and twice the frequency.
  double fractal(glm::dvec3 point, int octaves) const;

 private:
  double lattice(std::int64_t x, std::int64_t y, std::int64_t z, const glm::dvec3& offset) const;
  std::uint64_t seed_;
};

}  // namespace raysplats::synth
