// SPDX-License-Identifier: Apache-2.0
// depth_slopes: the gradient of scale |E / d - 1| for the expected depth E of every pixel whose
// depth d is known. With the sum S of T alpha t over a ray and its coverage A, E is S / A: dL/dS is
// written, dL/dA added to the fourth plane of the image's gradient.
//
// Launch: one work-item per pixel, any group size.
//   image   planar R, G, B, A
//   depth   planar, the expected depth first
//   target  d per pixel, 0 where it is unknown
// Pixels that nearly nothing covers have no depth and no gradient.
// Complexity: one pass over the pixels.
#define LEAST_COVERAGE 0.1f

__kernel void depth_slopes(const __global float* image,
                           const __global float* depth,
                           const __global float* target,
                           __global float* image_gradient,
                           __global float* depth_gradient,
                           uint pixels,
                           float scale) {
  const size_t i = get_global_id(0);
  if (i >= pixels) return;
  const float d = target[i];
  const float coverage = image[3 * (size_t)pixels + i];
  float slope = 0.0f;
  if (d > 0.0f && coverage > LEAST_COVERAGE) {
    const float expected = depth[i];
    const float sign = expected > d ? 1.0f : (expected < d ? -1.0f : 0.0f);
    slope = sign * scale / (d * coverage);
    image_gradient[3 * (size_t)pixels + i] -= slope * expected;
  }
  depth_gradient[i] = slope;
}
