// SPDX-License-Identifier: Apache-2.0
// depth_slopes: the gradient of m scale |E / d - 1| for the expected depth E of every pixel whose
// depth d is known. With the sum S of T alpha t over a ray and its coverage A, E is S / A: dL/dS is
// written, dL/dA added to the fourth plane of the image's gradient. How much a pixel counts, m, is
// the photo's alpha, times its plane of weights where it has one: neither what a mask leaves out
// nor what a cut-out photo does not show has a depth to obey.
//
// Launch: one work-item per pixel, any group size.
//   image   planar R, G, B, A
//   depth   planar, the expected depth first
//   target  d per pixel, 0 where it is unknown
// Pixels that nearly nothing covers have no depth and no gradient.
// Complexity: one pass over the pixels.
#define LANES 1
#include "train/photo.h"

#define LEAST_COVERAGE 0.1f

__kernel void depth_slopes(const __global float* image,
                           const __global float* depth,
                           const __global float* target,
                           const __global uint* photo,
                           __global float* image_gradient,
                           __global float* depth_gradient,
                           uint pixels,
                           int planes,
                           int weighted,
                           float scale) {
  const size_t i = get_global_id(0);
  if (i >= pixels) return;
  const float d = target[i];
  const float coverage = image[3 * (size_t)pixels + i];
  float slope = 0.0f;
  if (d > 0.0f && coverage > LEAST_COVERAGE) {
    const float expected = depth[i];
    const float sign = expected > d ? 1.0f : (expected < d ? -1.0f : 0.0f);
    const float alpha = rs_photo_channel(photo, planes, pixels, i, 1, 3);
    const float weight = weighted ? rs_photo_weight(photo, planes, pixels, i, 1) : 1.0f;
    slope = sign * alpha * weight * scale / (d * coverage);
    image_gradient[3 * (size_t)pixels + i] -= slope * expected;
  }
  depth_gradient[i] = slope;
}
