// SPDX-License-Identifier: Apache-2.0
// The gradient of m scale |E / d - 1| for the expected depth E of every pixel whose depth d is
// known. With the sum S of T alpha t over a ray and its coverage A, E is S / A: dL/dS is written,
// dL/dA added to the fourth plane of the image's gradient. How much a pixel counts, m, is the
// photo's alpha, times its plane of weights where it has one: neither what a mask leaves out nor
// what a cut-out photo does not show has a depth to obey.
//
// add_depth_gradient: one work-item per pixel.
//   image   planar R, G, B, A
//   depth   planar, the expected depth first
//   target  d per pixel, 0 where it is unknown
// add_listed_depth_gradient: one work-item per known depth, where those are few; writes nothing of
//   the other pixels.
//   at      the pixels, each once
//   target  d of each of them
// Launch: any group size. Pixels that nearly nothing covers have no depth and no gradient.
// Complexity: one pass over the pixels, or over the known depths.
#define LANES 1
#include "train/photo.h"

#define LEAST_COVERAGE 0.1f

// dL/dS of pixel i, whose depth is d; adds dL/dA.
float depth_gradient_of(const __global float* image,
                        const __global float* depth,
                        const __global uint* photo,
                        __global float* image_gradient,
                        size_t i,
                        uint pixels,
                        float d,
                        int planes,
                        int weighted,
                        float scale) {
  const float coverage = image[3 * (size_t)pixels + i];
  if (!(d > 0.0f && coverage > LEAST_COVERAGE)) return 0.0f;
  const float expected = depth[i];
  const float sign = expected > d ? 1.0f : (expected < d ? -1.0f : 0.0f);
  const float alpha = rs_photo_channel(photo, planes, pixels, i, 1, 3);
  const float weight = weighted ? rs_photo_weight(photo, planes, pixels, i, 1) : 1.0f;
  const float by_sum = sign * alpha * weight * scale / (d * coverage);
  image_gradient[3 * (size_t)pixels + i] -= by_sum * expected;
  return by_sum;
}

__kernel void add_depth_gradient(const __global float* image,
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
  depth_gradient[i] = depth_gradient_of(image, depth, photo, image_gradient, i, pixels, target[i],
                                        planes, weighted, scale);
}

__kernel void add_listed_depth_gradient(const __global float* image,
                                        const __global float* depth,
                                        const __global uint* at,
                                        const __global float* target,
                                        const __global uint* photo,
                                        __global float* image_gradient,
                                        __global float* depth_gradient,
                                        uint count,
                                        uint pixels,
                                        int planes,
                                        int weighted,
                                        float scale) {
  const size_t k = get_global_id(0);
  if (k >= count) return;
  const size_t i = at[k];
  depth_gradient[i] = depth_gradient_of(image, depth, photo, image_gradient, i, pixels, target[k],
                                        planes, weighted, scale);
}
