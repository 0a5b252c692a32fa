// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "raysplats/camera.hpp"

namespace raysplats {

/// How far apart the centres of neighbouring pixels are where they lie closest: at depth 1 (pinhole
/// and OpenCV), at distance 1 (fisheye and panorama) or anywhere (orthographic). 0 for cameras of
/// no picture.
double pixel_spacing(const Camera& camera);

/// The share `footprint` of that, as kernels take it.
float footprint_width(const Camera& camera, float footprint);

}  // namespace raysplats
