// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "raysplats/camera.hpp"
#include "raysplats/image.hpp"

namespace raysplats::view {

/// The camera of a sample: the places of a pixel's rays fill it evenly, however many there are
/// (Halton 1960). The first goes through its centre, as those of `render` do.
Camera jittered(Camera camera, std::uint64_t sample);

/// Alpha as grey, opaque.
Image alpha_picture(const Image& rgba);
/// Grey of a depth (its first channel): near white, far black, on the scale of the picture's own
/// nearest and farthest; where alpha (last channel of `alpha`) is less than half, black.
Image depth_picture(const Image& depth, const Image& alpha);

/// Sums of normals (3 channels, world axes) in the colours of normals_preview(), opaque.
Image normals_picture(const Image& sums, const Image& alpha, const Camera& camera);
/// Number of hits, the third channel of a depth, as grey: the most of the picture white; opaque.
Image hits_picture(const Image& depth);

}  // namespace raysplats::view
