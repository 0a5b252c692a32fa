// SPDX-License-Identifier: Apache-2.0
// The tree that arbitrary rays walk, and one ray against one of its nodes. Vectors run across the
// LANES children of a node, not across rays: rays without coherence share no boxes. The tree is
// implicit: things in `order`, blocks of LANES consecutive ones, level-1 nodes over LANES
// consecutive blocks, and so on up to one root. Wide nodes as slabs per lane: Dammertz et al. 2008,
// Wald et al. 2008.
#ifndef RS_BVH_LBVH_NODE_H
#define RS_BVH_LBVH_NODE_H

#include "bvh/box.h"
#include "bvh/ray.h"
#include "parallel/vector_lanes.h"
#include "shared/tree_layout.h"

// Without TRAIL the numbers of the LANES children of a node, and of the things in a leaf block, are
// vectors. With TRAIL, where a ray tests one thing or two children at a time (GPUs), the numbers of
// each lie together: a few reads of 16 bytes fetch them, and rays that wait for each other's reads
// find all of one in the cache. RS_LANE_FLOAT is the place of number k of `numbers` in a lane.
#if TRAIL
#define RS_LANE_FLOAT(numbers, k, lane) ((lane) * (numbers) + (k))
#else
#define RS_LANE_FLOAT(numbers, k, lane) ((k)*LANES + (lane))
#endif

// A node: lo.x lo.y lo.z hi.x hi.y hi.z of its children (RS_NODE_VECTORS). Missing children are
// empty boxes (lo > hi).
#define RS_NODE_FLOAT(k, lane) RS_LANE_FLOAT(RS_NODE_VECTORS, k, lane)

// A child of every level stays behind: LANES - 1 per level, and 2^31 things have 15 levels of 4 or
// 7 of 16.
#define RS_NODE_STACK 128

// The tree and its leaf blocks as arguments of kernels that walk it: how many levels of nodes, the
// first node of level l, from 1, at level_begin[l].
#define RS_TREE_ARGUMENTS                                                                         \
  const int levels, __global const uint *restrict level_begin, __global const fv *restrict nodes, \
      __global const fv *restrict blocks

typedef union {
  fv v;
  float s[LANES];
} RayLanes;

// What a ray tests at once of a leaf block: with TRAIL one lane of it, so that few numbers are
// alive, else all LANES.
#if TRAIL
#define RS_BLOCK_LANES 1
typedef float bv;
typedef int bi;
#define RS_BLOCK_MASK(comparison) (-(comparison))
#define rs_block_any(mask) ((mask) != 0)
#define rs_block_bits(mask) ((uint)((mask)&1))
#else
#define RS_BLOCK_LANES LANES
typedef fv bv;
typedef iv bi;
#define RS_BLOCK_MASK(comparison) RS_MASK(comparison)
#define rs_block_any(mask) rs_any(mask)
#define rs_block_bits(mask) rs_lane_bits(mask)
#endif

typedef union {
  bv v;
  float s[RS_BLOCK_LANES];
} BlockLanes;

// Whether rays are cones, for which boxes reach farther (RS_BOX_MARGIN).
#ifndef CONES
#define CONES 0
#endif

typedef struct {
  float3 o, d, inverse;
  float3 shift;  // o / d
  float t_min;
  int side[3];  // vector of the near slab along each axis; the far one is 3 further or 3 before
#if CONES
  float width, spread;  // RsCone
  float reach;          // of a Gaussian, in standard deviations
#endif
} RayData;

// What slabs are tested with, from the ray's origin and direction.
RS_INLINE void ray_slabs(RayData* ray) {
  // Finite, so that an origin on a slab of a zero component gives about 0 and never NaN.
  ray->inverse = clamp(1.0f / ray->d, -1e24f, 1e24f);
  // Finite too: missing children reach to infinity, and the difference would be NaN.
  ray->shift = clamp(ray->o * ray->inverse, -FLT_MAX, FLT_MAX);
  ray->side[0] = ray->inverse.x < 0.0f ? 3 : 0;
  ray->side[1] = ray->inverse.y < 0.0f ? 4 : 1;
  ray->side[2] = ray->inverse.z < 0.0f ? 5 : 2;
}

// A ray whose numbers, or their squares, are not finite meets nothing. NaN would meet every box,
// and those of children that do not exist.
RS_INLINE RayData ray_data(const Ray ray) {
  RayData out;
  const float squares = dot(ray.origin, ray.origin) + dot(ray.direction, ray.direction);
  const bool sound = squares <= FLT_MAX;
  out.o = sound ? ray.origin : (float3)(0.0f, 0.0f, 0.0f);
  out.d = sound ? ray.direction : (float3)(0.0f, 0.0f, 1.0f);
  out.t_min = sound ? fmax(ray.t_min, 0.0f) : INFINITY;
#if CONES
  out.width = out.spread = out.reach = 0.0f;
#endif
  ray_slabs(&out);
  return out;
}

// Depth of a slab. With RS_EXACT_SLABS it is good to a few units in the last place even far from
// the world's origin, so that no ray slips between boxes that touch (surfaces need that); the plain
// form is one operation, and three more numbers per ray, which GPUs have no registers for.
#if defined(RS_EXACT_SLABS) || TRAIL
#define RS_SLAB(plane, axis) (((plane)-ray->o.axis) * ray->inverse.axis)
#else
#define RS_SLAB(plane, axis) ((plane)*ray->inverse.axis - ray->shift.axis)
#endif

#if CONES
// Makes a ray a cone. quantile: that of the options, which no Gaussian's exceeds.
RS_INLINE void widen_ray(const RsCone cone, const float quantile, RayData* ray) {
  ray->width = cone.width;
  ray->spread = cone.spread;
  ray->reach = sqrt(quantile);
}

// How much farther than their boxes things reach for a cone: what they grow by where the cone is
// widest, at the corner that is farthest along the ray. That of a missing child is less than the
// FLT_MAX by which its box ends before it begins; fmax takes none for NaN.
#define RS_BOX_MARGIN(type, far_x, far_y, far_z)                                 \
  (ray->reach * fmax(ray->width + ray->spread * (((far_x)-ray->o.x) * ray->d.x + \
                                                 ((far_y)-ray->o.y) * ray->d.y + \
                                                 ((far_z)-ray->o.z) * ray->d.z), \
                     (type)(0.0f)))
#endif

// Children of a node whose boxes the ray crosses within [t_min, t_end], one bit each; *entry their
// entry depths.
RS_INLINE uint ray_meets_boxes(const RayData* ray,
                               __global const fv* node,
                               float t_end,
                               fv* entry) {
  const int sx = ray->side[0], sy = ray->side[1], sz = ray->side[2];
  fv nx = RS_SLAB(node[sx], x);
  fv fx = RS_SLAB(node[3 - sx], x);
  fv ny = RS_SLAB(node[sy], y);
  fv fy = RS_SLAB(node[5 - sy], y);
  fv nz = RS_SLAB(node[sz], z);
  fv fz = RS_SLAB(node[7 - sz], z);
#if CONES
  const fv margin = RS_BOX_MARGIN(fv, node[3 - sx], node[5 - sy], node[7 - sz]);
  const float3 growth = fabs(ray->inverse);
  nx -= margin * growth.x;
  fx += margin * growth.x;
  ny -= margin * growth.y;
  fy += margin * growth.y;
  nz -= margin * growth.z;
  fz += margin * growth.z;
#endif
  // Rounding must not lose a grazing box (Ize 2013).
  const fv near = max(max(nx, ny), max(nz, (fv)(ray->t_min * 0.999999f)));
  const fv far = min(min(fx, fy), min(fz, (fv)(t_end))) * 1.0000004f;
  *entry = near;
  return rs_lane_bits(RS_MASK(near <= far));
}

// Box `lane` of a node.
RsBox load_child(__global const float* nodes, size_t node, uint lane) {
  __global const float* from = nodes + node * (RS_NODE_VECTORS * LANES);
  RsBox box;
  box.lo = (float4)(from[RS_NODE_FLOAT(0, lane)], from[RS_NODE_FLOAT(1, lane)],
                    from[RS_NODE_FLOAT(2, lane)], 0.0f);
  box.hi = (float4)(from[RS_NODE_FLOAT(3, lane)], from[RS_NODE_FLOAT(4, lane)],
                    from[RS_NODE_FLOAT(5, lane)], 0.0f);
  return box;
}

void store_child(__global float* nodes, size_t node, uint lane, RsBox box) {
  __global float* to = nodes + node * (RS_NODE_VECTORS * LANES);
  to[RS_NODE_FLOAT(0, lane)] = box.lo.x;
  to[RS_NODE_FLOAT(1, lane)] = box.lo.y;
  to[RS_NODE_FLOAT(2, lane)] = box.lo.z;
  to[RS_NODE_FLOAT(3, lane)] = box.hi.x;
  to[RS_NODE_FLOAT(4, lane)] = box.hi.y;
  to[RS_NODE_FLOAT(5, lane)] = box.hi.z;
}

#endif
