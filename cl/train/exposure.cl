// SPDX-License-Identifier: Apache-2.0
// An affine colour of each photo: x'[c] = x[c] + sum_k d[c][k] x[k] + d[c][3], with 12 numbers d a
// photo whose mean over all photos is zero (Kerbl et al. 2024 have such a matrix, without the
// mean).
//
// apply_exposure: one work-item per pixel. image, out: planar R, G, B, A; A is copied.
// exposure_gradient: one work-item per block of BLOCK pixels. Turns gradient = dL/dx' into dL/dx in
//   place; partials[12 block + 4 c + k] = dL/dd of the block's pixels.
// exposure_sums: one work-item per coefficient, 12 in all. Adds the partials in their order, as the
//   gradient of one view of a step: sums[12 slot + k].
// exposure_step: likewise. Makes a step of Adam (Kingma and Ba 2015) for the photo of a slot, whose
//   own number of steps is `step`, and takes the mean over the photos off. Does nothing where the
//   guard's word is not 0 or the gradient is not finite.
// Complexity: pixels + blocks + photos.
#ifndef BLOCK
#define BLOCK 256
#endif

__kernel void apply_exposure(const __global float* image,
                             const __global float* deltas,
                             __global float* out,
                             uint pixels,
                             uint view) {
  const size_t i = get_global_id(0);
  if (i >= pixels) return;
  const __global float* d = deltas + 12 * (size_t)view;
  const float r = image[i];
  const float g = image[pixels + i];
  const float b = image[2 * (size_t)pixels + i];
  out[i] = r + d[0] * r + d[1] * g + d[2] * b + d[3];
  out[pixels + i] = g + d[4] * r + d[5] * g + d[6] * b + d[7];
  out[2 * (size_t)pixels + i] = b + d[8] * r + d[9] * g + d[10] * b + d[11];
  out[3 * (size_t)pixels + i] = image[3 * (size_t)pixels + i];
}

__kernel void exposure_gradient(const __global float* image,
                                const __global float* deltas,
                                __global float* gradient,
                                __global float* partials,
                                uint pixels,
                                uint view) {
  const size_t block = get_global_id(0);
  const size_t begin = block * BLOCK;
  if (begin >= pixels) return;
  const size_t end = min(begin + BLOCK, (size_t)pixels);
  const size_t plane = pixels;
  float d[12], sum[12];
  for (int k = 0; k < 12; ++k) {
    d[k] = deltas[12 * (size_t)view + k];
    sum[k] = 0.0f;
  }
  for (size_t i = begin; i < end; ++i) {
    const float x[4] = {image[i], image[plane + i], image[2 * plane + i], 1.0f};
    const float g[3] = {gradient[i], gradient[plane + i], gradient[2 * plane + i]};
    for (int c = 0; c < 3; ++c) {
      for (int k = 0; k < 4; ++k) sum[4 * c + k] += g[c] * x[k];
    }
    for (int k = 0; k < 3; ++k)
      gradient[k * plane + i] = g[k] + d[k] * g[0] + d[4 + k] * g[1] + d[8 + k] * g[2];
  }
  for (int k = 0; k < 12; ++k) partials[12 * block + k] = sum[k];
}

__kernel void exposure_sums(const __global float* partials,
                            __global float* sums,
                            uint blocks,
                            uint slot) {
  const uint k = get_global_id(0);
  if (k >= 12) return;
  float sum = 0.0f;
  for (uint block = 0; block < blocks; ++block) sum += partials[12 * (size_t)block + k];
  sums[12 * (size_t)slot + k] = sum;
}

__kernel void exposure_step(const __global float* sums,
                            const __global uint* guard,
                            __global float* deltas,
                            __global float* first,
                            __global float* second,
                            __global float* steps,
                            uint slot,
                            uint views,
                            uint view,
                            float rate,
                            float beta1,
                            float beta2,
                            float epsilon) {
  const uint k = get_global_id(0);
  if (k >= 12 || guard[0] != 0) return;
  const float gradient = sums[12 * (size_t)slot + k];
  if ((as_uint(gradient) & 0x7f800000u) == 0x7f800000u) return;
  const size_t at = 12 * (size_t)view + k;
  const float step = steps[at] + 1.0f;
  steps[at] = step;
  first[at] = beta1 * first[at] + (1.0f - beta1) * gradient;
  second[at] = beta2 * second[at] + (1.0f - beta2) * gradient * gradient;
  const float mean = first[at] / (1.0f - pow(beta1, step));
  const float square = second[at] / (1.0f - pow(beta2, step));
  deltas[at] -= rate * mean / (sqrt(square) + epsilon);
  float sum = 0.0f;
  for (uint v = 0; v < views; ++v) sum += deltas[12 * (size_t)v + k];
  const float off = sum / views;
  for (uint v = 0; v < views; ++v) deltas[12 * (size_t)v + k] -= off;
}
