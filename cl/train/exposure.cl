// SPDX-License-Identifier: Apache-2.0
// An affine colour of each photo: x'[c] = x[c] + sum_k d[c][k] z[k], with 12 numbers d a photo
// whose mean over the photos that steps show is zero (Kerbl et al. 2024 have such a matrix, without
// the mean, and train it). z = (x, 1); where photos are cut out (CUT_OUT) it is the light of the
// Gaussians and their coverage, (x - (1 - A) b, A), since no exposure changes the background b.
//
// apply_exposure: one work-item per pixel. image, out: planar R, G, B, A; A is copied.
// exposure_backward: one work-item per pixel. Turns gradient = dL/dx' into dL/dx in place. Where
//   photos are cut out it adds to dL/dA what x' has of A by z.
// exposure_moments: one work-item per block of BLOCK pixels. With the photo's straight colour y and
//   its weight m, alpha times what its plane of weights says (`composite` as in
//   train/loss_prepare.cl), partials[24 block + j] are the sums of m z[a] z[b] (10 for a <= b, row
//   by row) and of m z[a] (z[3] y[c] - z[c]) (4 for each c), then the sum of m and a zero.
// exposure_sums: one work-group of GROUP work-items per sum, 24 in all. Adds the partials, as those
//   of one view of a step: sums[24 slot + j].
// exposure_solve: one work-group of GROUP work-items. The first makes the rows d[c] of the photo of
//   a slot what minimises
//   sum m (d[c] z - (z[3] y[c] - z[c]))^2 / sum m + damping |d[c] - before|^2 (a step of the
//   proximal point method, Rockafellar 1976), by Cholesky's factors of a 4 x 4 matrix whose
//   eigenvalues are at least `damping`; then all of them take the mean over the photos off.
//   `members` photos have part in it: all, or where these are fewer than the `views`, those whose
//   word in `waits` is 0. Does nothing where the guard's word is not 0, nothing of the photo
//   counts, or a sum is not finite.
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
#ifndef CUT_OUT
#define CUT_OUT 0
#endif
#define SUMS 24
#define NUMBERS 12

// What the affine colour of a pixel is of.
void light_of(const __global float* image, size_t pixels, size_t i, const float* behind, float* z) {
  z[3] = CUT_OUT ? image[3 * pixels + i] : 1.0f;
  for (int c = 0; c < 3; ++c) {
    z[c] = image[c * pixels + i];
    if (CUT_OUT) z[c] -= (1.0f - z[3]) * behind[c];
  }
}

__kernel void apply_exposure(const __global float* image,
                             const __global float* deltas,
                             __global float* out,
                             uint pixels,
                             uint view,
                             float red,
                             float green,
                             float blue) {
  const size_t i = get_global_id(0);
  if (i >= pixels) return;
  const __global float* d = deltas + 12 * (size_t)view;
  const size_t plane = pixels;
  const float behind[3] = {red, green, blue};
  float z[4];
  light_of(image, plane, i, behind, z);
  for (int c = 0; c < 3; ++c) {
    out[c * plane + i] = image[c * plane + i] + d[4 * c] * z[0] + d[4 * c + 1] * z[1] +
                         d[4 * c + 2] * z[2] + d[4 * c + 3] * z[3];
  }
  out[3 * plane + i] = image[3 * plane + i];
}

__kernel void exposure_backward(const __global float* deltas,
                                __global float* gradient,
                                uint pixels,
                                uint view,
                                float red,
                                float green,
                                float blue) {
  const size_t i = get_global_id(0);
  if (i >= pixels) return;
  const size_t plane = pixels;
  const __global float* d = deltas + 12 * (size_t)view;
  const float g[3] = {gradient[i], gradient[plane + i], gradient[2 * plane + i]};
  for (int k = 0; k < 3; ++k)
    gradient[k * plane + i] = g[k] + d[k] * g[0] + d[4 + k] * g[1] + d[8 + k] * g[2];
  if (CUT_OUT) {
    float by_coverage = 0.0f;
    for (int c = 0; c < 3; ++c) {
      by_coverage +=
          g[c] * (d[4 * c] * red + d[4 * c + 1] * green + d[4 * c + 2] * blue + d[4 * c + 3]);
    }
    gradient[3 * plane + i] += by_coverage;
  }
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
    const float weight =
        composite == 2 ? alpha * rs_photo_weight(photo, planes, pixels, i, 1) : alpha;
    float z[4];
    light_of(image, pixels, i, behind, z);
    int j = 0;
    for (int a = 0; a < 4; ++a) {
      for (int b = a; b < 4; ++b) sum[j++] += weight * z[a] * z[b];
    }
    for (int c = 0; c < 3; ++c) {
      const float y = rs_photo_channel(photo, planes, pixels, i, 1, c);
      for (int a = 0; a < 4; ++a) sum[j++] += weight * z[a] * (z[3] * y - z[c]);
    }
    sum[j] += weight;
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
  return s[22] > 0.0f;  // the sum of the weights
}

// The numbers d of a photo by its sums s.
void fit_colors(const __global float* s, __global float* d, float damping) {
  const float all = s[22];
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
    const __global uint* waits,
    __global float* deltas,
    uint slot,
    uint views,
    uint members,
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
    if (members < views && waits[v]) continue;
    for (int k = 0; k < NUMBERS; ++k) sum[k] += deltas[NUMBERS * (size_t)v + k];
  }
  for (int k = 0; k < NUMBERS; ++k) rows[GROUP * k + lane] = sum[k];
  add_rows(rows, NUMBERS);
  if (!fits) return;
  for (int k = 0; k < NUMBERS; ++k) sum[k] = rows[GROUP * k] / members;  // the mean
  for (uint v = lane; v < views; v += GROUP) {
    if (members < views && waits[v]) continue;
    for (int k = 0; k < NUMBERS; ++k) deltas[NUMBERS * (size_t)v + k] -= sum[k];
  }
}
