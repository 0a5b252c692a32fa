// SPDX-License-Identifier: Apache-2.0
// One ray against a leaf block of the tree over Gaussians (bvh/lbvh_node.h): LANES Gaussians at
// once.
#ifndef RS_TRACE_RAY_BLOCK_H
#define RS_TRACE_RAY_BLOCK_H

#include "bvh/tree_walk.h"
#include "shared/layout.h"
#include "shared/tree_layout.h"

#ifndef ADAPTIVE_RADIUS
#define ADAPTIVE_RADIUS 0
#endif
#ifndef PEAK_ORDER
#define PEAK_ORDER 0
#endif
// Gaussians whose means are too near are not met: by their distance with RS_LENS_AROUND, else by
// their depth along an axis.
#ifndef NEAR_LIMIT
#define NEAR_LIMIT 0
#endif
#ifndef LENS
#define LENS RS_LENS_PINHOLE
#endif

// A block, all that its Gaussians need while they are traced in one place: the upper triangles
// a b c d e f of their whitening matrices divided by sqrt(Q), which makes the confidence ellipsoid
// the unit sphere, and the means (NaN where no ray may meet a Gaussian); Q / 2 with
// ADAPTIVE_RADIUS or TRAIL; the opacities; the indices of the Gaussians as bits; then per lane the
// colour of SH degree 0 and a zero. With TRAIL that is 64 bytes for each Gaussian, all in one line.
#define RS_BLOCK_QUANTILES (ADAPTIVE_RADIUS || TRAIL ? 1 : 0)
#define RS_BLOCK_OPACITY (9 + RS_BLOCK_QUANTILES)
#define RS_BLOCK_INDEX RS_GAUSSIAN_INDEX(RS_BLOCK_QUANTILES)
#define RS_BLOCK_COLOR (RS_BLOCK_INDEX + 1)
#define RS_BLOCK_VECTORS RS_GAUSSIAN_VECTORS(RS_BLOCK_QUANTILES)
#if RS_BLOCK_VECTORS != RS_BLOCK_COLOR + 4 || RS_BLOCK_INDEX != RS_BLOCK_OPACITY + 1
#error "the colours are the end of a block"
#endif

// Where number k of a lane lies in a block, and its colour.
#define RS_BLOCK_FLOAT(k, lane) RS_LANE_FLOAT(RS_BLOCK_VECTORS, k, lane)
#if TRAIL
#define RS_BLOCK_COLOR_FLOAT(lane) RS_BLOCK_FLOAT(RS_BLOCK_COLOR, lane)
#else
#define RS_BLOCK_COLOR_FLOAT(lane) (RS_BLOCK_COLOR * LANES + 4 * (lane))
#endif

// How a ray passes the Gaussians of a block, in the space where they are unit spheres.
typedef struct {
  BlockLanes cross2;      // |o' x d'|^2
  BlockLanes direction2;  // |d'|^2
  BlockLanes along;       // <o', d'>
  BlockLanes origin2;     // |o'|^2
} BlockMeeting;

// Gaussians whose ellipsoids the ray's line meets, without those that it cannot hit because of its
// origin; one bit each; with TRAIL 1 or 0 for the one in `lane`. near: axis and depth from the
// origin that means have to reach, for NEAR_LIMIT. cross2 / direction2 is the squared distance of
// the line: no division.
RS_INLINE uint ray_meets_block(const RayData* ray,
                               const float4 near,
                               __global const fv* block,
                               const uint lane,
                               BlockMeeting* meeting) {
#if TRAIL
  __global const float4* record = block + RS_BLOCK_VECTORS / 4 * lane;
  const float4 abcd = record[0], efxy = record[1];
  const float a = abcd.x, b = abcd.y, c = abcd.z, d = abcd.w, e = efxy.x, f = efxy.y;
  const float x = ray->o.x - efxy.z, y = ray->o.y - efxy.w, z = ray->o.z - record[2].x;
#else
  (void)lane;
  const fv a = block[0], b = block[1], c = block[2], d = block[3], e = block[4], f = block[5];
  const fv x = ray->o.x - block[6], y = ray->o.y - block[7], z = ray->o.z - block[8];
#endif
  const bv ox = a * x + b * y + c * z, oy = d * y + e * z, oz = f * z;
  const bv dx = a * ray->d.x + b * ray->d.y + c * ray->d.z;
  const bv dy = d * ray->d.y + e * ray->d.z;
  const bv dz = f * ray->d.z;
  const bv dd = dx * dx + dy * dy + dz * dz;
  const bv cx = oy * dz - oz * dy, cy = oz * dx - ox * dz, cz = ox * dy - oy * dx;
  const bv cc = cx * cx + cy * cy + cz * cz;
#if NEAR_LIMIT && LENS != RS_LENS_AROUND
  const bi inside =
      RS_BLOCK_MASK(cc <= dd) & RS_BLOCK_MASK(-(near.x * x + near.y * y + near.z * z) >= near.w);
#elif NEAR_LIMIT
  const bi inside =
      RS_BLOCK_MASK(cc <= dd) & RS_BLOCK_MASK(x * x + y * y + z * z >= near.w * near.w);
#else
  (void)near;
  const bi inside = RS_BLOCK_MASK(cc <= dd);
#endif
  if (!rs_block_any(inside)) return 0;
  const bv along = ox * dx + oy * dy + oz * dz;
  const bv origin2 = ox * ox + oy * oy + oz * oz;
  meeting->cross2.v = cc;
  meeting->direction2.v = dd;
  meeting->along.v = along;
  meeting->origin2.v = origin2;
#if PEAK_ORDER
  return rs_block_bits(inside & RS_BLOCK_MASK(along <= 0.0f));
#else
  return rs_block_bits(inside & RS_BLOCK_MASK(along < 0.0f) & RS_BLOCK_MASK(origin2 >= 1.0f));
#endif
}

float block_opacity(__global const fv* block, uint lane) {
  return ((__global const float*)block)[RS_BLOCK_FLOAT(RS_BLOCK_OPACITY, lane)];
}

#if ADAPTIVE_RADIUS
float block_half_quantile(__global const fv* block, uint lane) {
  return ((__global const float*)block)[RS_BLOCK_FLOAT(9, lane)];
}
#endif

uint block_index(__global const fv* block, uint lane) {
  return ((__global const uint*)block)[RS_BLOCK_FLOAT(RS_BLOCK_INDEX, lane)];
}

RS_INLINE float4 block_color(__global const fv* block, uint lane) {
  return vload4(0, (__global const float*)block + RS_BLOCK_COLOR_FLOAT(lane));
}

RS_INLINE float3 block_mean(__global const fv* block, uint lane) {
  __global const float* numbers = (__global const float*)block;
  return (float3)(numbers[RS_BLOCK_FLOAT(RS_GAUSSIAN_MEAN, lane)],
                  numbers[RS_BLOCK_FLOAT(RS_GAUSSIAN_MEAN + 1, lane)],
                  numbers[RS_BLOCK_FLOAT(RS_GAUSSIAN_MEAN + 2, lane)]);
}

#endif
