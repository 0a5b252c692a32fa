// SPDX-License-Identifier: Apache-2.0
// One ray against a leaf block of the tree over Gaussians (bvh/lbvh_node.h): PACKET Gaussians at
// once.
#ifndef RS_TRACE_RAY_BLOCK_H
#define RS_TRACE_RAY_BLOCK_H

#include "bvh/lbvh_node.h"
#include "shared/layout.h"
#include "shared/tree_layout.h"

#ifndef ADAPTIVE_RADIUS
#define ADAPTIVE_RADIUS 0
#endif
#ifndef PEAK_ORDER
#define PEAK_ORDER 0
#endif
// Gaussians whose means are too near are not met: 1 by their depth along an axis, 2 by their
// distance.
#ifndef NEAR_PLANE
#define NEAR_PLANE 0
#endif

// A block, all that its Gaussians need while they are traced in one place: the upper triangles
// a b c d e f of their whitening matrices divided by sqrt(Q), which makes the confidence ellipsoid
// the unit sphere, and the means (NaN where no ray may meet a Gaussian); Q / 2 with
// ADAPTIVE_RADIUS; the opacities; the indices of the Gaussians as bits; then per lane the colour of
// SH degree 0 and a zero.
#define RS_BLOCK_OPACITY (9 + ADAPTIVE_RADIUS)
#define RS_BLOCK_INDEX (RS_BLOCK_OPACITY + 1)
#define RS_BLOCK_COLOR (RS_BLOCK_INDEX + 1)
#define RS_BLOCK_VECTORS RS_GAUSSIAN_VECTORS(ADAPTIVE_RADIUS)
#if RS_BLOCK_VECTORS != RS_BLOCK_COLOR + 4
#error "the colours are the end of a block"
#endif

// How a ray passes the Gaussians of a block, in the space where they are unit spheres.
typedef struct {
  RayLanes cross2;      // |o' x d'|^2
  RayLanes direction2;  // |d'|^2
  RayLanes along;       // <o', d'>
  RayLanes origin2;     // |o'|^2
} BlockMeeting;

// Gaussians whose ellipsoids the ray's line meets, without those that it cannot hit because of its
// origin; one bit each. near: axis and depth from the origin that means have to reach, for
// NEAR_PLANE. cross2 / direction2 is the squared distance of the line: no division.
uint ray_meets_block(const RayData* ray,
                     const float4 near,
                     __global const fv* block,
                     BlockMeeting* meeting) {
  const fv a = block[0], b = block[1], c = block[2], d = block[3], e = block[4], f = block[5];
  const fv x = ray->o.x - block[6], y = ray->o.y - block[7], z = ray->o.z - block[8];
  const fv ox = a * x + b * y + c * z, oy = d * y + e * z, oz = f * z;
  const fv dx = a * ray->d.x + b * ray->d.y + c * ray->d.z;
  const fv dy = d * ray->d.y + e * ray->d.z;
  const fv dz = f * ray->d.z;
  const fv dd = dx * dx + dy * dy + dz * dz;
  const fv cx = oy * dz - oz * dy, cy = oz * dx - ox * dz, cz = ox * dy - oy * dx;
  const fv cc = cx * cx + cy * cy + cz * cz;
#if NEAR_PLANE == 1
  const iv inside = RS_MASK(cc <= dd) & RS_MASK(-(near.x * x + near.y * y + near.z * z) >= near.w);
#elif NEAR_PLANE == 2
  const iv inside = RS_MASK(cc <= dd) & RS_MASK(x * x + y * y + z * z >= near.w * near.w);
#else
  (void)near;
  const iv inside = RS_MASK(cc <= dd);
#endif
  if (!rs_any(inside)) return 0;
  const fv along = ox * dx + oy * dy + oz * dz;
  const fv origin2 = ox * ox + oy * oy + oz * oz;
  meeting->cross2.v = cc;
  meeting->direction2.v = dd;
  meeting->along.v = along;
  meeting->origin2.v = origin2;
#if PEAK_ORDER
  return rs_lane_bits(inside & RS_MASK(along <= 0.0f));
#else
  return rs_lane_bits(inside & RS_MASK(along < 0.0f) & RS_MASK(origin2 >= 1.0f));
#endif
}

float block_opacity(__global const fv* block, uint lane) {
  return ((__global const float*)(block + RS_BLOCK_OPACITY))[lane];
}

#if ADAPTIVE_RADIUS
float block_half_quantile(__global const fv* block, uint lane) {
  return ((__global const float*)(block + 9))[lane];
}
#endif

uint block_index(__global const fv* block, uint lane) {
  return ((__global const uint*)(block + RS_BLOCK_INDEX))[lane];
}

float4 block_color(__global const fv* block, uint lane) {
  return vload4(lane, (__global const float*)(block + RS_BLOCK_COLOR));
}

#endif
