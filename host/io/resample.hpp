// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "raysplats/camera.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/image.hpp"

namespace raysplats::io {

/// Average over the area of each target pixel, colours weighted by alpha. `rgba` has 4 channels
/// with straight alpha, and so has the result; pixels without any coverage are 0. O(pixels of both
/// images).
Image area_resample(const Image& rgba, int width, int height);

/// The picture that a pinhole camera with the intrinsics and size of this kOpenCv camera would have
/// taken (bilinear, colours weighted by alpha). Pixels whose ray leaves the photo, or lies beyond
/// lens_limit(), get alpha 0.
Image undistort(Image rgba, const Camera& camera);

/// Divides a picture whose alpha is coverage times weight (so that colours come from what counts)
/// by the weight, which is the alpha of `weight`.
ViewPicture take_weight(Image rgba, const Image& weight);

/// Sets alpha to 0 where the camera's lens (kOpenCv or kFisheye) sees nothing: beyond the image of
/// lens_limit().
void mask_unseen(Image& rgba, const Camera& camera);

}  // namespace raysplats::io
