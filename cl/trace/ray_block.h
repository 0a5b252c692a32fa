// SPDX-License-Identifier: Apache-2.0
// The tree that arbitrary rays walk, and one ray against one of its nodes or leaf blocks. Vectors
// run across PACKET child boxes and across PACKET Gaussians, not across rays: rays without
// coherence share no candidates. The tree is implicit: Gaussians in `order`, blocks of PACKET
// consecutive ones, level-1 nodes over PACKET consecutive blocks, and so on up to one root.
// Wide nodes as slabs per lane: Dammertz et al. 2008, Wald et al. 2008.
#ifndef RS_TRACE_RAY_BLOCK_H
#define RS_TRACE_RAY_BLOCK_H

#include "trace/packet.h"

#ifndef ADAPTIVE_RADIUS
#define ADAPTIVE_RADIUS 0
#endif
#ifndef PEAK_ORDER
#define PEAK_ORDER 0
#endif

// A node: lo.x lo.y lo.z hi.x hi.y hi.z of its children, one vector each. Missing children are
// empty boxes (lo > hi).
#define RS_NODE_VECTORS 6
// A block, all that its Gaussians need while they are traced in one place: the upper triangles
// a b c d e f of their whitening matrices divided by sqrt(Q), which makes the confidence ellipsoid
// the unit sphere, and the means (NaN where no ray may meet a Gaussian); Q / 2 with
// ADAPTIVE_RADIUS; the opacities; the indices of the Gaussians as bits; then per lane the colour of
// SH degree 0 and a zero.
#define RS_BLOCK_OPACITY (9 + ADAPTIVE_RADIUS)
#define RS_BLOCK_INDEX (RS_BLOCK_OPACITY + 1)
#define RS_BLOCK_COLOR (RS_BLOCK_INDEX + 1)
#define RS_BLOCK_VECTORS (RS_BLOCK_COLOR + 4)

// rs_lane_bits, by the mask registers where the compiler has a word for them.
#if PACKET == 16 && defined(__AVX512DQ__) && defined(__has_builtin)
#if __has_builtin(__builtin_ia32_cvtd2mask512)
#define RS_MASK_REGISTERS 1
#endif
#endif
#ifdef RS_MASK_REGISTERS
typedef int rs_mask_lanes __attribute__((vector_size(64)));
#define ray_lane_bits(mask) ((uint)(ushort)__builtin_ia32_cvtd2mask512((rs_mask_lanes)(mask)))
#else
#define ray_lane_bits(mask) rs_lane_bits(mask)
#endif

typedef union {
  fv v;
  float s[PACKET];
} RayLanes;

typedef struct {
  float3 o, d, inverse;
  float3 shift;  // o / d
  float t_min;
  int side[3];  // vector of the near slab along each axis; the far one is 3 further or 3 before
} RayData;

RayData ray_data(float8 ray) {
  RayData out;
  out.o = ray.s012;
  out.d = ray.s456;
  out.t_min = fmax(ray.s3, 0.0f);
  // Finite, so that an origin on a slab of a zero component gives about 0 and never NaN.
  out.inverse = clamp(1.0f / out.d, -1e24f, 1e24f);
  out.shift = out.o * out.inverse;
  out.side[0] = out.inverse.x < 0.0f ? 3 : 0;
  out.side[1] = out.inverse.y < 0.0f ? 4 : 1;
  out.side[2] = out.inverse.z < 0.0f ? 5 : 2;
  return out;
}

// Children of a node whose boxes the ray crosses within [t_min, t_end], one bit each; *entry their
// entry depths.
uint ray_meets_boxes(const RayData* ray, __global const fv* node, float t_end, fv* entry) {
  const int sx = ray->side[0], sy = ray->side[1], sz = ray->side[2];
  const fv nx = node[sx] * ray->inverse.x - ray->shift.x;
  const fv fx = node[3 - sx] * ray->inverse.x - ray->shift.x;
  const fv ny = node[sy] * ray->inverse.y - ray->shift.y;
  const fv fy = node[5 - sy] * ray->inverse.y - ray->shift.y;
  const fv nz = node[sz] * ray->inverse.z - ray->shift.z;
  const fv fz = node[7 - sz] * ray->inverse.z - ray->shift.z;
  // Rounding must not lose a grazing box (Ize 2013).
  const fv near = max(max(nx, ny), max(nz, (fv)(ray->t_min * 0.999999f)));
  const fv far = min(min(fx, fy), min(fz, (fv)(t_end))) * 1.0000004f;
  *entry = near;
  return ray_lane_bits(RS_MASK(near <= far));
}

// How a ray passes the Gaussians of a block, in the space where they are unit spheres.
typedef struct {
  RayLanes cross2;      // |o' x d'|^2
  RayLanes direction2;  // |d'|^2
  RayLanes along;       // <o', d'>
  RayLanes origin2;     // |o'|^2
} BlockMeeting;

// Gaussians whose ellipsoids the ray's line meets, without those that it cannot hit because of its
// origin; one bit each. cross2 / direction2 is the squared distance of the line: no division.
uint ray_meets_block(const RayData* ray, __global const fv* block, BlockMeeting* meeting) {
  const fv a = block[0], b = block[1], c = block[2], d = block[3], e = block[4], f = block[5];
  const fv x = ray->o.x - block[6], y = ray->o.y - block[7], z = ray->o.z - block[8];
  const fv ox = a * x + b * y + c * z, oy = d * y + e * z, oz = f * z;
  const fv dx = a * ray->d.x + b * ray->d.y + c * ray->d.z;
  const fv dy = d * ray->d.y + e * ray->d.z;
  const fv dz = f * ray->d.z;
  const fv dd = dx * dx + dy * dy + dz * dz;
  const fv cx = oy * dz - oz * dy, cy = oz * dx - ox * dz, cz = ox * dy - oy * dx;
  const fv cc = cx * cx + cy * cy + cz * cz;
  const iv inside = RS_MASK(cc <= dd);
  if (!rs_any(inside)) return 0;
  const fv along = ox * dx + oy * dy + oz * dz;
  const fv origin2 = ox * ox + oy * oy + oz * oz;
  meeting->cross2.v = cc;
  meeting->direction2.v = dd;
  meeting->along.v = along;
  meeting->origin2.v = origin2;
#if PEAK_ORDER
  return ray_lane_bits(inside & RS_MASK(along <= 0.0f));
#else
  return ray_lane_bits(inside & RS_MASK(along < 0.0f) & RS_MASK(origin2 >= 1.0f));
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
