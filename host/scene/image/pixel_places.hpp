// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>

#include "raysplats/camera.hpp"

namespace raysplats {

/// Where in a pixel ray `sample` of `samples` goes, the same in every pixel, counted from its
/// centre in pixels: each coordinate in [-1/2, 1/2). One sample goes through the centre. More are a
/// lattice of rank 1 (Korobov 1959) whose step is the golden section of their number: every
/// `samples`-th part of a row and of a column has one ray. Their mean is the centre for seed 0;
/// other seeds shift the lattice around the pixel (Cranley and Patterson 1976), so that the mean
/// over seeds is that over the pixel. The third coordinate is for panoramas (moved_in_pixels()).
glm::dvec3 pixel_place(std::uint64_t sample, std::uint64_t samples, std::uint64_t seed);

/// The camera whose rays through the centres of pixels are those of `camera` through the places
/// that lie `place` from them. A panorama has no centre to move: it is turned by what a pixel of
/// its height sees.
Camera moved_in_pixels(Camera camera, const glm::dvec3& place);

}  // namespace raysplats
