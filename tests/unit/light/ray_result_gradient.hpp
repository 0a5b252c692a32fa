// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "raysplats/tracer.hpp"
#include "util/rng.hpp"

namespace raysplats {

inline RayResultGradient random_gradient(CounterRng& rng) {
  RayResultGradient g{};
  for (float& value : g.color) value = static_cast<float>(rng.normal());
  g.alpha = static_cast<float>(rng.normal());
  return g;
}

}  // namespace raysplats
