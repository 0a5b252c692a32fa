// SPDX-License-Identifier: Apache-2.0
// One ray against a leaf block of the tree over triangles (bvh/lbvh_node.h): LANES triangles at
// once. Watertight: Woop, Benthin and Wald 2013, with edge functions whose signs are right in
// single precision by the difference of products of Kahan (Jeannerod, Louvet and Muller 2013), so
// that neighbours always agree about a shared edge.
#ifndef RS_LIGHT_TRIANGLE_BLOCK_H
#define RS_LIGHT_TRIANGLE_BLOCK_H

#define RS_EXACT_SLABS
#include "bvh/tree_walk.h"
#include "shared/light_layout.h"
#include "shared/tree_layout.h"

// A block: x y z of the first, second and third corners (NaN in lanes without a triangle), then the
// indices of the triangles as bits.
#define RS_TRIANGLE_INDEX 9
#if RS_TRIANGLE_VECTORS != RS_TRIANGLE_INDEX + 1
#error "the indices are the end of a block"
#endif

#define RS_TRIANGLE_FLOAT(k, lane) RS_LANE_FLOAT(RS_TRIANGLE_VECTORS, k, lane)
#if TRAIL
#define RS_TRIANGLE_VALUE(block, k, lane) \
  (((__global const float*)(block))[RS_TRIANGLE_FLOAT(k, lane)])
#else
#define RS_TRIANGLE_VALUE(block, k, lane) ((block)[k])
#endif

// The ray's axes permuted so that z is the longest, and the shear that makes it (0, 0, 1).
typedef struct {
  int x, y, z;
  float ox, oy, oz;
  float sx, sy, sz;
} ShearedRay;

// Not an array: indexed by a number that is not known, it would lie in memory.
RS_INLINE float along_axis(const float3 v, const int axis) {
  return axis == 0 ? v.x : axis == 1 ? v.y : v.z;
}

RS_INLINE ShearedRay sheared_ray(const RayData* ray) {
  const float3 o = ray->o, d = ray->d;
  ShearedRay out;
  out.z = fabs(d.x) > fabs(d.y) ? (fabs(d.x) > fabs(d.z) ? 0 : 2) : (fabs(d.y) > fabs(d.z) ? 1 : 2);
  out.x = out.z == 2 ? 0 : out.z + 1;
  out.y = out.x == 2 ? 0 : out.x + 1;
  out.ox = along_axis(o, out.x);
  out.oy = along_axis(o, out.y);
  out.oz = along_axis(o, out.z);
  out.sx = along_axis(d, out.x) / along_axis(d, out.z);
  out.sy = along_axis(d, out.y) / along_axis(d, out.z);
  out.sz = 1.0f / along_axis(d, out.z);
  return out;
}

// a b - c d, whose sign is exact.
bv difference_of_products(bv a, bv b, bv c, bv d) {
  const bv product = c * d;
  const bv error = fma(-c, d, product);
  return fma(a, b, -product) + error;
}

typedef struct {
  BlockLanes t, u, v;
  uint own;  // not through an edge or a corner that belongs to a neighbour
} TriangleMeeting;

// Whether a triangle whose a, b, c are positive has its edge from p to q, which the ray meets, and
// not the neighbour there, which runs through it the other way: that which the ray would cross
// moved by (e, e^2) for a tiny e. Boxes hold their lower sides, where rays run along them.
RS_INLINE bi owns_edge(bv px, bv py, bv qx, bv qy) {
  return RS_BLOCK_MASK(qy > py) | (RS_BLOCK_MASK(qy == py) & RS_BLOCK_MASK(qx < px));
}

// Triangles whose plane the ray crosses inside, in (t_min, t_max], one bit each, of the
// RS_BLOCK_LANES from `lane` on.
RS_INLINE uint ray_meets_triangles(const ShearedRay* ray,
                                   __global const fv* block,
                                   const uint lane,
                                   float t_min,
                                   float t_max,
                                   TriangleMeeting* meeting) {
  (void)lane;
  const bv az = RS_TRIANGLE_VALUE(block, ray->z, lane) - ray->oz;
  const bv bz = RS_TRIANGLE_VALUE(block, 3 + ray->z, lane) - ray->oz;
  const bv cz = RS_TRIANGLE_VALUE(block, 6 + ray->z, lane) - ray->oz;
  const bv ax = fma((bv)(-ray->sx), az, RS_TRIANGLE_VALUE(block, ray->x, lane) - ray->ox);
  const bv bx = fma((bv)(-ray->sx), bz, RS_TRIANGLE_VALUE(block, 3 + ray->x, lane) - ray->ox);
  const bv cx = fma((bv)(-ray->sx), cz, RS_TRIANGLE_VALUE(block, 6 + ray->x, lane) - ray->ox);
  const bv ay = fma((bv)(-ray->sy), az, RS_TRIANGLE_VALUE(block, ray->y, lane) - ray->oy);
  const bv by = fma((bv)(-ray->sy), bz, RS_TRIANGLE_VALUE(block, 3 + ray->y, lane) - ray->oy);
  const bv cy = fma((bv)(-ray->sy), cz, RS_TRIANGLE_VALUE(block, 6 + ray->y, lane) - ray->oy);
  const bv a = difference_of_products(cx, by, cy, bx);
  const bv b = difference_of_products(ax, cy, ay, cx);
  const bv c = difference_of_products(bx, ay, by, ax);
  const bi front = RS_BLOCK_MASK(a >= 0.0f) & RS_BLOCK_MASK(b >= 0.0f) & RS_BLOCK_MASK(c >= 0.0f);
  const bi back = RS_BLOCK_MASK(a <= 0.0f) & RS_BLOCK_MASK(b <= 0.0f) & RS_BLOCK_MASK(c <= 0.0f);
  const bi inside = front | back;
  if (!rs_block_any(inside)) return 0;
  const bv sum = a + b + c;
  const bv reciprocal = 1.0f / sum;
  meeting->own = rs_block_bits(~((RS_BLOCK_MASK(a == 0.0f) & (front ^ owns_edge(bx, by, cx, cy))) |
                                 (RS_BLOCK_MASK(b == 0.0f) & (front ^ owns_edge(cx, cy, ax, ay))) |
                                 (RS_BLOCK_MASK(c == 0.0f) & (front ^ owns_edge(ax, ay, bx, by)))));
  meeting->t.v = (a * az + b * bz + c * cz) * ray->sz * reciprocal;
  meeting->u.v = b * reciprocal;
  meeting->v.v = c * reciprocal;
  return rs_block_bits(inside & RS_BLOCK_MASK(sum != 0.0f) & RS_BLOCK_MASK(meeting->t.v > t_min) &
                       RS_BLOCK_MASK(meeting->t.v <= t_max));
}

int triangle_index(__global const fv* block, uint lane) {
  return ((__global const int*)block)[RS_TRIANGLE_FLOAT(RS_TRIANGLE_INDEX, lane)];
}

#endif
