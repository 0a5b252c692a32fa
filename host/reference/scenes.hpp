// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "raysplats/camera.hpp"
#include "raysplats/gaussians.hpp"

namespace raysplats::reference {

/// `count` Gaussians with means uniform in [-1, 1]^3, random rotations, sizes for which a ray
/// through the cube meets tens of them whatever the count, opacity logits -1.5 +- 1.5 and normal SH
/// coefficients.
Gaussians random_scene(std::size_t count, std::uint64_t seed, int sh_degree);

/// Camera at (0, 0, -4) that looks along +z at the cube [-1, 1]^3; image y points along world +y.
Camera cube_camera(int width, int height);

/// A turned camera off every axis, whose principal point is off the middle.
Camera posed(CameraModel model,
             int width,
             int height,
             double fx,
             double fy,
             const Distortion& distortion = {});

}  // namespace raysplats::reference
