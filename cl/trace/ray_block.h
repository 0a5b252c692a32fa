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
//
// Blocks for cones, which raise axes: three times the unit vector of an axis and its scale; the
// mean and Q / 2; the opacity, the index and two numbers that let the colour begin at 16 bytes.
#if CONES
#define RS_BLOCK_MEAN RS_CONE_MEAN
#define RS_BLOCK_QUANTILE (RS_CONE_MEAN + 3)
#define RS_BLOCK_OPACITY (RS_CONE_MEAN + 4)
#define RS_BLOCK_INDEX RS_CONE_INDEX
#define RS_BLOCK_COLOR (RS_CONE_VECTORS - 4)
#define RS_BLOCK_VECTORS RS_CONE_VECTORS
#else
#define RS_BLOCK_QUANTILES (ADAPTIVE_RADIUS || TRAIL ? 1 : 0)
#define RS_BLOCK_MEAN RS_GAUSSIAN_MEAN
#define RS_BLOCK_QUANTILE (RS_GAUSSIAN_MEAN + 3)
#define RS_BLOCK_OPACITY (RS_BLOCK_QUANTILE + RS_BLOCK_QUANTILES)
#define RS_BLOCK_INDEX RS_GAUSSIAN_INDEX(RS_BLOCK_QUANTILES)
#define RS_BLOCK_COLOR (RS_BLOCK_INDEX + 1)
#define RS_BLOCK_VECTORS RS_GAUSSIAN_VECTORS(RS_BLOCK_QUANTILES)
#endif
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

#if CONES
#include "trace/ray_cone.h"
#endif

// How a ray passes the Gaussians of a block, in the space where they are unit spheres.
typedef struct {
  BlockLanes cross2;      // |o' x d'|^2
  BlockLanes direction2;  // |d'|^2
  BlockLanes along;       // <o', d'>
  BlockLanes origin2;     // |o'|^2
#if CONES
  BlockLanes opacity, half_quantile;  // as the cone sees them
#endif
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
#if CONES
  const ConePlace at = cone_place(ray, block, lane);
  const ConeMeeting cone = cone_meets(ray, block, lane, at);
  const bv x = at.x, y = at.y, z = at.z;
  const bv ox = cone.origin[0], oy = cone.origin[1], oz = cone.origin[2];
  const bv dx = cone.direction[0], dy = cone.direction[1], dz = cone.direction[2];
  const bv reach2 = 2.0f * RS_BLOCK_NUMBER(RS_BLOCK_QUANTILE);
#else
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
  const bv reach2 = (bv)(1.0f);
#endif
  bv dd = dx * dx + dy * dy + dz * dz;
  const bv cx = oy * dz - oz * dy, cy = oz * dx - ox * dz, cz = ox * dy - oy * dx;
  bv cc = cx * cx + cy * cy + cz * cz;
#if NEAR_LIMIT && LENS != RS_LENS_AROUND
  bi inside = RS_BLOCK_MASK(cc <= reach2 * dd) &
              RS_BLOCK_MASK(-(near.x * x + near.y * y + near.z * z) >= near.w);
#elif NEAR_LIMIT
  bi inside =
      RS_BLOCK_MASK(cc <= reach2 * dd) & RS_BLOCK_MASK(x * x + y * y + z * z >= near.w * near.w);
#else
  (void)near;
  bi inside = RS_BLOCK_MASK(cc <= reach2 * dd);
#endif
  if (!rs_block_any(inside)) return 0;
  bv along = ox * dx + oy * dy + oz * dz;
  bv origin2 = ox * ox + oy * oy + oz * oz;
#if CONES
  // The ellipsoid of what is left of the opacity becomes the unit sphere.
  const bv opacity = RS_BLOCK_NUMBER(RS_BLOCK_OPACITY) * cone_dilution(ray, block, lane, at);
  const bv half_quantile = cone_half_quantile(RS_BLOCK_NUMBER(RS_BLOCK_QUANTILE), opacity);
  inside &= RS_BLOCK_MASK(half_quantile > 0.0f) & RS_BLOCK_MASK(cc <= 2.0f * half_quantile * dd);
  meeting->opacity.v = opacity;
  meeting->half_quantile.v = half_quantile;
  const bv unit = 0.5f / half_quantile;
  cc *= unit * unit;
  dd *= unit;
  along *= unit;
  origin2 *= unit;
#endif
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

// Opacity and Q / 2 of a Gaussian that the ray meets.
RS_INLINE float met_opacity(const BlockMeeting* meeting, __global const fv* block, uint lane) {
#if CONES
  (void)block;
  return meeting->opacity.s[lane % RS_BLOCK_LANES];
#else
  (void)meeting;
  return ((__global const float*)block)[RS_BLOCK_FLOAT(RS_BLOCK_OPACITY, lane)];
#endif
}

#if ADAPTIVE_RADIUS
RS_INLINE float met_half_quantile(const BlockMeeting* meeting,
                                  __global const fv* block,
                                  uint lane) {
#if CONES
  (void)block;
  return meeting->half_quantile.s[lane % RS_BLOCK_LANES];
#else
  (void)meeting;
  return ((__global const float*)block)[RS_BLOCK_FLOAT(RS_BLOCK_QUANTILE, lane)];
#endif
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
  return (float3)(numbers[RS_BLOCK_FLOAT(RS_BLOCK_MEAN, lane)],
                  numbers[RS_BLOCK_FLOAT(RS_BLOCK_MEAN + 1, lane)],
                  numbers[RS_BLOCK_FLOAT(RS_BLOCK_MEAN + 2, lane)]);
}

#endif
