// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "raysplats/camera.hpp"
#include "raysplats/image.hpp"

namespace raysplats::io {

/// Average over the area of each target pixel, colours weighted by alpha. `rgba` has 4 channels
/// with straight alpha, and so has the result; pixels without any coverage are 0. O(pixels of both
/// images).
Image area_resample(const Image& rgba, int width, int height);

/// The picture that a pinhole camera with the same intrinsics and size would have taken (bilinear,
/// colours weighted by alpha). Pixels whose ray leaves the photo, or lies beyond the angle at which
/// the polynomial stops growing, get alpha 0. Model: Brown 1966 as in OpenCV.
Image undistort(Image rgba, const Camera& camera, const Distortion& distortion);

/// Where the lens maps the normalised image point (x, y).
inline void distort(
    const Distortion& d, double x, double y, double& distorted_x, double& distorted_y) {
  const double r2 = x * x + y * y;
  const double radial = 1 + r2 * (d.k1 + r2 * (d.k2 + r2 * d.k3));
  distorted_x = x * radial + 2 * d.p1 * x * y + d.p2 * (r2 + 2 * x * x);
  distorted_y = y * radial + d.p1 * (r2 + 2 * y * y) + 2 * d.p2 * x * y;
}

}  // namespace raysplats::io
