// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <cstdint>
#include <numbers>

namespace raysplats {

/// Counter-based random numbers: the value depends on (seed, stream, counter) alone, so that a
/// resumed run continues exactly. Mixing after SplitMix64 (Steele, Lea, Flood 2014).
class CounterRng {
 public:
  CounterRng(std::uint64_t seed, std::uint64_t stream, std::uint64_t counter = 0)
      : key_(mix(seed ^ mix(stream + 0x9e3779b97f4a7c15ull))), counter_(counter) {}

  std::uint64_t bits() { return mix(key_ + 0x9e3779b97f4a7c15ull * ++counter_); }
  /// Uniform in [0, 1).
  double uniform() { return static_cast<double>(bits() >> 11) * 0x1.0p-53; }
  /// Uniform integer in [0, bound).
  std::uint64_t below(std::uint64_t bound) { return bits() % bound; }
  /// Standard normal (Box and Muller 1958).
  double normal() {
    const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform()));
    return radius * std::cos(2.0 * std::numbers::pi * uniform());
  }
  std::uint64_t counter() const { return counter_; }

 private:
  static std::uint64_t mix(std::uint64_t z) {
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9ull;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebull;
    return z ^ (z >> 31);
  }
  std::uint64_t key_;
  std::uint64_t counter_;
};

}  // namespace raysplats
