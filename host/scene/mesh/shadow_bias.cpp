// SPDX-License-Identifier: Apache-2.0
#include "scene/mesh/shadow_bias.hpp"

#include <algorithm>
#include <limits>

#include "scene/camera/orbit.hpp"

namespace raysplats {

float shadow_bias(const Scene& scene) {
  if (scene.render.bias > 0.0f) return scene.render.bias;
  constexpr double kMost = std::numeric_limits<float>::max();
  return static_cast<float>(std::min(2e-3 * scene_extent(scene.gaussians).radius, kMost));
}

}  // namespace raysplats
