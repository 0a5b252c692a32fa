// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <glm/vec2.hpp>

#include "raysplats/image.hpp"

namespace raysplats {

/// The shift of a picture in its plane, in pixels, that brings it closest to its photo, and what it
/// brings.
struct ShiftFit {
  glm::dvec2 shift{0.0};  ///< the picture at x + shift is like the photo at x
  double gain = 0;        ///< dB of weighted_psnr(), of the pixels that have a place in the picture
};

/// By Gauss and Newton's steps on brightness, first on reduced pictures (Lucas and Kanade 1981;
/// Bouguet 2001). Errors of a camera's turn, and largely of its place, are such shifts; models of
/// sound poses gain less than 0.2 dB of a photo. Pictures of equal size, `weight` of one channel.
/// The number of cores does not change a bit.
ShiftFit fit_shift(const Image& image, const Image& photo, const Image& weight);

}  // namespace raysplats
