// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "raysplats/trace_options.hpp"

namespace raysplats {

/// Trains the coefficients of a sky (trace/sky.hpp) by Adam (0.9, 0.999).
class SkyAdam {
 public:
  /// Moments and steps, one number for each of the coefficients.
  struct State {
    std::vector<float> first, second, steps;
  };

  /// `numbers`: 3 a coefficient.
  SkyAdam(Context& context, std::size_t numbers);

  /// One step down the gradient unless the guard is marked. Enqueues without waiting.
  void step(const Buffer<float>& gradient,
            const Buffer<float>& coefficients,
            double rate,
            const Buffer<std::uint32_t>& guard);

  /// Blocks.
  State state() const;
  /// Throws DataError when it is not of as many numbers.
  void restore(const State& state);

 private:
  Kernel step_;
  Buffer<float> first_, second_, steps_;
};

/// A sky of that degree with the same colour everywhere.
SkyLight even_sky(int degree, const std::array<float, 3>& color);

}  // namespace raysplats
