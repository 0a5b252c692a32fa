// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "raysplats/scene.hpp"

namespace raysplats {

/// Where shadow rays from Gaussians start, in world units: RenderSettings::bias, or where that is 0
/// a thousandth of the size of the Gaussians (twice the radius of scene_extent(), which strays and
/// backgrounds leave as it is). Meshes count for nothing: the bias is for how sharp a captured
/// surface is, and next to a large ground or sky no shadow would be left.
float shadow_bias(const Scene& scene);

}  // namespace raysplats
