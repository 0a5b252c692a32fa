// SPDX-License-Identifier: Apache-2.0
// An affine colour of each photo: x'[c] = x[c] + sum_k d[c][k] x[k] + d[c][3], with 12 numbers d a
// photo whose mean over all photos is zero (Kerbl et al. 2024 have such a matrix, without the
// mean, and train it).
//
// apply_exposure: one work-item per pixel. image, out: planar R, G, B, A; A is copied.
// exposure_backward: one work-item per pixel. Turns gradient = dL/dx' into dL/dx in place.
// exposure_moments: one work-item per block of BLOCK pixels. With z = (x, 1), the photo's colour y
//   and its weight m (`composite` as in train/loss_prepare.cl), partials[24 block + j] are the sums
//   of m z[a] z[b] (10 for a <= b, row by row) and of m z[a] (y[c] - x[c]) (4 for each c), then two
//   zeros.
// exposure_sums: one work-group of GROUP work-items per sum, 24 in all. Adds the partials, as those
//   of one view of a step: sums[24 slot + j].
// exposure_solve: one work-group of GROUP work-items. The first makes the rows d[c] of the photo of
//   a slot what minimises
//   sum m (d[c] z - (y[c] - x[c]))^2 / sum m + damping |d[c] - before|^2 (a step of the proximal
//   point method, Rockafellar 1976), by Cholesky's factors of a 4 x 4 matrix whose eigenvalues are
//   at least `damping`; then all of them take the mean over the photos off. Does nothing where the
//   guard's word is not 0, nothing of the photo counts, or a sum is not finite.
// Sums over blocks and photos: a work-item adds every GROUP-th, and what the work-items have is
// added in a tree, so that their order is the same everywhere.
// Complexity: pixels + (blocks + photos) / GROUP.
#define LANES 1
#include "train/photo.h"

#ifndef BLOCK
#define BLOCK 256
#endif
#ifndef GROUP
#define GROUP 64  // a power of two
#endif
#define SUMS 24
#define NUMBERS 12

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

__kernel void exposure_backward(const __global float* deltas,
                                __global float* gradient,
                                uint pixels,
                                uint view) {
  const size_t i = get_global_id(0);
  if (i >= pixels) return;
  const size_t plane = pixels;
  const __global float* d = deltas + 12 * (size_t)view;
  const float g[3] = {gradient[i], gradient[plane + i], gradient[2 * plane + i]};
  for (int k = 0; k < 3; ++k)
    gradient[k * plane + i] = g[k] + d[k] * g[0] + d[4 + k] * g[1] + d[8 + k] * g[2];
}

__kernel void exposure_moments(const __global float* image,
                               const __global uint* photo,
                               __global float* partials,
                               int pixels,
                               int planes,
                               int composite,
                               float red,
                               float green,
                               float blue) {
  const int block = get_global_id(0);
  const int begin = block * BLOCK;
  if (begin >= pixels) return;
  const int end = min(begin + BLOCK, pixels);
  const float behind[3] = {red, green, blue};
  float sum[SUMS];
  for (int j = 0; j < SUMS; ++j) sum[j] = 0.0f;
  for (int i = begin; i < end; ++i) {
    const float alpha = rs_photo_channel(photo, planes, pixels, i, 1, 3);
    const float share = composite ? alpha : 1.0f;
    const float weight =
        composite == 0 ? alpha
                       : (composite == 1 ? 1.0f : rs_photo_weight(photo, planes, pixels, i, 1));
    const float z[4] = {image[i], image[(size_t)pixels + i], image[2 * (size_t)pixels + i], 1.0f};
    int j = 0;
    for (int a = 0; a < 4; ++a) {
      for (int b = a; b < 4; ++b) sum[j++] += weight * z[a] * z[b];
    }
    for (int c = 0; c < 3; ++c) {
      const float y =
          rs_photo_channel(photo, planes, pixels, i, 1, c) * share + behind[c] * (1.0f - share);
      for (int a = 0; a < 4; ++a) sum[j++] += weight * z[a] * (y - z[c]);
    }
  }
  for (int j = 0; j < SUMS; ++j) partials[SUMS * (size_t)block + j] = sum[j];
}

// Adds `count` rows of GROUP numbers, one of each work-item, to their first numbers. Every
// work-item calls it, and finds the sums when it is back.
void add_rows(__local float* rows, int count) {
  const uint lane = get_local_id(0);
  for (uint half_size = GROUP / 2; half_size > 0; half_size /= 2) {
    barrier(CLK_LOCAL_MEM_FENCE);
    if (lane < half_size) {
      for (int k = 0; k < count; ++k) rows[GROUP * k + lane] += rows[GROUP * k + lane + half_size];
    }
  }
  barrier(CLK_LOCAL_MEM_FENCE);
}

__attribute__((reqd_work_group_size(GROUP, 1, 1))) __kernel void exposure_sums(
    const __global float* partials, __global float* sums, uint blocks, uint slot) {
  __local float row[GROUP];
  const uint j = get_group_id(0);
  const uint lane = get_local_id(0);
  float sum = 0.0f;
  for (uint block = lane; block < blocks; block += GROUP) sum += partials[SUMS * (size_t)block + j];
  row[lane] = sum;
  add_rows(row, 1);
  if (lane == 0) sums[SUMS * (size_t)slot + j] = row[0];
}

// Whether the sums of a photo say something.
int tells(const __global float* s) {
  for (int j = 0; j < SUMS; ++j) {
    if ((as_uint(s[j]) & 0x7f800000u) == 0x7f800000u) return 0;
  }
  return s[9] > 0.0f;  // the sum of the weights
}

// The numbers d of a photo by its sums s.
void fit_colors(const __global float* s, __global float* d, float damping) {
  const float all = s[9];
  float L[4][4];  // the lower factor; its diagonal inverted
  int j = 0;
  for (int a = 0; a < 4; ++a) {
    for (int b = a; b < 4; ++b) L[b][a] = s[j++] / all + (a == b ? damping : 0.0f);
  }
  for (int a = 0; a < 4; ++a) {
    for (int b = 0; b < a; ++b) {
      for (int k = 0; k < b; ++k) L[a][b] -= L[a][k] * L[b][k];
      L[a][b] *= L[b][b];
      L[a][a] -= L[a][b] * L[a][b];
    }
    L[a][a] = 1.0f / sqrt(fmax(L[a][a], 0.5f * damping));  // rounding may take a little off
  }
  for (int c = 0; c < 3; ++c) {
    float x[4];
    for (int a = 0; a < 4; ++a) {
      x[a] = s[10 + 4 * c + a] / all + damping * d[4 * c + a];
      for (int b = 0; b < a; ++b) x[a] -= L[a][b] * x[b];
      x[a] *= L[a][a];
    }
    for (int a = 3; a >= 0; --a) {
      for (int b = a + 1; b < 4; ++b) x[a] -= L[b][a] * x[b];
      x[a] *= L[a][a];
    }
    for (int a = 0; a < 4; ++a) d[4 * c + a] = x[a];
  }
}

__attribute__((reqd_work_group_size(GROUP, 1, 1))) __kernel void exposure_solve(
    const __global float* sums,
    const __global uint* guard,
    __global float* deltas,
    uint slot,
    uint views,
    uint view,
    float damping) {
  __local float rows[NUMBERS * GROUP];
  const uint lane = get_local_id(0);
  const __global float* s = sums + SUMS * (size_t)slot;
  const int fits = guard[0] == 0 && tells(s);  // the same for all, as barriers ask for
  if (fits && lane == 0) fit_colors(s, deltas + NUMBERS * (size_t)view, damping);
  barrier(CLK_GLOBAL_MEM_FENCE);
  float sum[NUMBERS];
  for (int k = 0; k < NUMBERS; ++k) sum[k] = 0.0f;
  for (uint v = lane; v < views; v += GROUP) {
    for (int k = 0; k < NUMBERS; ++k) sum[k] += deltas[NUMBERS * (size_t)v + k];
  }
  for (int k = 0; k < NUMBERS; ++k) rows[GROUP * k + lane] = sum[k];
  add_rows(rows, NUMBERS);
  if (!fits) return;
  for (int k = 0; k < NUMBERS; ++k) sum[k] = rows[GROUP * k] / views;  // the mean
  for (uint v = lane; v < views; v += GROUP) {
    for (int k = 0; k < NUMBERS; ++k) deltas[NUMBERS * (size_t)v + k] -= sum[k];
  }
}
