// SPDX-License-Identifier: Apache-2.0
// fill_blocks: the leaf blocks of the tree over Gaussians (ray_block.h) in the order of the tree:
// matrices, means, opacities and colours in lanes, and the boxes of the blocks.
#include "bvh/box.h"
#include "parallel/prefetch.h"
#include "shared/color.h"
#include "shared/sh.h"
#include "trace/arguments.h"
#define ONE_GAUSSIAN
#include "trace/gaussian.h"
#include "trace/ray_block.h"

// Upper triangle a b c d e f with |(a x + b y + c z, d y + e z, f z)|^2 = |S^-1 R^T (x, y, z)|^2,
// divided by `radius`. Every diagonal entry is a quotient of sums of squares, so nothing cancels
// for thin Gaussians.
void whitening_triangle(const float* R, const float* scale, float radius, float* out) {
  const float longest = fmax(scale[0], fmax(scale[1], scale[2]));
  float r[3], w[3];
  for (int k = 0; k < 3; ++k) {
    r[k] = fmax(scale[k] / longest, 1e-7f);
    r[k] *= r[k];
    w[k] = 1.0f / r[k];
  }
  // Entries of the covariance and of its inverse, relative to the longest axis.
  const float zz = R[6] * R[6] * r[0] + R[7] * R[7] * r[1] + R[8] * R[8] * r[2];
  const float yz = R[3] * R[6] * r[0] + R[4] * R[7] * r[1] + R[5] * R[8] * r[2];
  const float minor = R[0] * R[0] * (r[1] * r[2]) + R[1] * R[1] * (r[0] * r[2]) +
                      R[2] * R[2] * (r[0] * r[1]);  // yy zz - yz^2
  const float ixx = R[0] * R[0] * w[0] + R[1] * R[1] * w[1] + R[2] * R[2] * w[2];
  const float ixy = R[0] * R[3] * w[0] + R[1] * R[4] * w[1] + R[2] * R[5] * w[2];
  const float ixz = R[0] * R[6] * w[0] + R[1] * R[7] * w[1] + R[2] * R[8] * w[2];
  const float unit = 1.0f / (longest * radius);
  const float a = sqrt(ixx), d = sqrt(zz / minor);
  out[0] = a * unit;
  out[1] = ixy / a * unit;
  out[2] = ixz / a * unit;
  out[3] = d * unit;
  out[4] = -d * yz / zz * unit;
  out[5] = unit / sqrt(zz);
}

// Launch: one work-item per block, `padded_blocks` (a multiple of LANES) at least: lanes of nodes
// without a block become empty boxes. Level 1 begins at node 0.
__kernel void fill_blocks(const uint count,
                          const uint padded_blocks,
                          __global const uint* restrict order,
                          __global const RsAabb* restrict boxes,
                          RS_GAUSSIAN_ARGUMENTS,
                          const int sh_coefficients,
                          const float quantile,
                          __global float* restrict blocks,
                          __global float* restrict nodes) {
  const uint block = get_global_id(0);
  if (block >= padded_blocks) return;
  // The parameters lie anywhere: all are on their way before the first is used.
  for (uint lane = 0; lane < LANES && (size_t)block * LANES + lane < count; ++lane) {
    const size_t index = order[(size_t)block * LANES + lane];
    RS_PREFETCH_READ(boxes + index);
    RS_PREFETCH_READ(quaternions + 4 * index);
    RS_PREFETCH_READ(scales + 3 * index);
    RS_PREFETCH_READ(means + 3 * index);
    RS_PREFETCH_READ(opacities + index);
    RS_PREFETCH_READ(sh + index * 3 * sh_coefficients);
    (void)index;
  }
  RsBox sum = box_empty();
  for (uint lane = 0; lane < LANES && (size_t)block * LANES < count; ++lane) {
    const size_t slot = (size_t)block * LANES + lane;
    float v[RS_BLOCK_COLOR];
    for (int k = 0; k < RS_BLOCK_COLOR; ++k) v[k] = NAN;
    float3 color = (float3)(0.0f);
    if (slot < count) {
      const uint index = order[slot];
      v[RS_BLOCK_INDEX] = as_float(index);
      const RsBox box = box_load_clean(boxes, index);
      sum = box_union(sum, box);
      const float4 q = vload4(index, quaternions);
      const float norm = sqrt(dot(q, q));
      float scale[3], R[9];
      float check = norm;
      for (int k = 0; k < 3; ++k) {
        // Thinner than this, 1 / scale^2 leaves float's range.
        scale[k] = fmax(rs_scale_of(scales[3 * (size_t)index + k]), 1e-12f);
        check += scale[k];
      }
      const float3 mean = vload3(index, means);
      const float opacity = rs_sigmoid(opacities[index]);
      const float Q = effective_quantile(quantile, opacity);
      check += opacity + fabs(mean.x) + fabs(mean.y) + fabs(mean.z);
      // An empty box stands for parameters with a NaN or an infinity as well.
      if (box.lo.x <= box.hi.x && isfinite(check) && norm > 0.0f && opacity > 0.0f && Q > 0.0f) {
        rotation_of(q / norm, R);
#if CONES
        for (int k = 0; k < 3; ++k) {
          for (int j = 0; j < 3; ++j) v[4 * k + j] = R[3 * j + k];
          v[4 * k + 3] = scale[k];
        }
#else
        whitening_triangle(R, scale, sqrt(Q), v);
#endif
        v[RS_BLOCK_MEAN] = mean.x;
        v[RS_BLOCK_MEAN + 1] = mean.y;
        v[RS_BLOCK_MEAN + 2] = mean.z;
        v[RS_BLOCK_QUANTILE] = 0.5f * Q;
        v[RS_BLOCK_OPACITY] = opacity;
      }
      color = 0.5f + RS_SH0 * vload3(0, sh + (size_t)index * 3 * sh_coefficients);
      color = fmin(fmax(color, (float3)(0.0f)), (float3)(RS_MAX_COLOR));
    }
    __global float* record = blocks + (size_t)block * (RS_BLOCK_VECTORS * LANES);
    for (int k = 0; k < RS_BLOCK_COLOR; ++k) record[RS_BLOCK_FLOAT(k, lane)] = v[k];
    vstore4((float4)(color, 0.0f), 0, record + RS_BLOCK_COLOR_FLOAT(lane));
  }
  store_child(nodes, block / LANES, block % LANES, sum);
}
