// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "raysplats/scene.hpp"

namespace raysplats {

/// Known mirrors of a scene of Gaussians. Every surface reflects from both sides, times the colour
/// of its material.
struct Mirrors {
  std::vector<Mesh> meshes;         ///< in world units
  std::vector<Material> materials;  ///< of the meshes, which index them
  int max_bounces = 4;  ///< mirrors that a ray may meet; a ray with more bounces sees black
};

}  // namespace raysplats
