// SPDX-License-Identifier: Apache-2.0
// The way of one ray through the tree of lbvh_node.h, near child first: walk_next() yields, one
// after the other, the nodes of the first level that the ray meets, with the blocks below them that
// it meets. What is asked of the blocks (nearest, any, all) is the caller's; it may bring t_end
// nearer meanwhile. Cost per node: LANES boxes at once, and the sort of the children met.
//   TRAIL 0: a stack of children not visited yet, with their depths (RS_NODE_STACK)
//   TRAIL 1: LANES is 4; two bytes per level, which children are left in which order. The parent
//   of
//            a node is known by its number, so nothing else is kept: 32 bytes of private memory.
//            Children behind t_end are found to be so when they are visited.
#ifndef RS_BVH_TREE_WALK_H
#define RS_BVH_TREE_WALK_H

#include "bvh/lbvh_node.h"

// Builds with COUNT_WORK 1 count the nodes that they test (trace/ray_tracer.cl).
#ifndef COUNT_WORK
#define COUNT_WORK 0
#endif

// The tree as RS_TREE_ARGUMENTS tell it.
typedef struct {
  int levels;
  __global const uint* level_begin;
  __global const fv* nodes;
  __global const fv* blocks;
} RayTree;

#if TRAIL
#if LANES != 4
#error "a trail has room for four children a node"
#endif

// Key that children_by_depth() gives children that the ray does not meet.
#define RS_NO_CHILD 0xffffffffu

typedef struct {
  ushort children[16];  // by level: lane + 1 of those left, four bits each, the next one lowest
  uint number;          // of the node within its level
  int level, root;
  bool arrived;  // at a node that is not tested yet
#if COUNT_WORK
  uint nodes;  // tested
#endif
} TreeWalk;

RS_INLINE void walk_begin(TreeWalk* walk, const RayTree* tree, const float t_min) {
  (void)t_min;
  walk->number = 0;
  walk->level = walk->root = tree->levels;
#if COUNT_WORK
  walk->nodes = 0;
#endif
  walk->arrived = tree->levels > 0;
  walk->children[walk->root] = 0;
}

// Where the ray enters a child, whose slabs are lo and hi: the bits of the depth, which is not
// negative, the two lowest of which give way to the child's lane. RS_NO_CHILD where it does not.
RS_INLINE uint child_key(
    const RayData* ray, const float3 lo, const float3 hi, const float t_end, const uint lane) {
  const float x0 = RS_SLAB(lo.x, x), x1 = RS_SLAB(hi.x, x);
  const float y0 = RS_SLAB(lo.y, y), y1 = RS_SLAB(hi.y, y);
  const float z0 = RS_SLAB(lo.z, z), z1 = RS_SLAB(hi.z, z);
  float nx = ray->inverse.x < 0.0f ? x1 : x0, fx = ray->inverse.x < 0.0f ? x0 : x1;
  float ny = ray->inverse.y < 0.0f ? y1 : y0, fy = ray->inverse.y < 0.0f ? y0 : y1;
  float nz = ray->inverse.z < 0.0f ? z1 : z0, fz = ray->inverse.z < 0.0f ? z0 : z1;
#if CONES
  const float margin =
      RS_BOX_MARGIN(float, ray->inverse.x < 0.0f ? lo.x : hi.x, ray->inverse.y < 0.0f ? lo.y : hi.y,
                    ray->inverse.z < 0.0f ? lo.z : hi.z);
  const float3 growth = margin * fabs(ray->inverse);
  nx -= growth.x;
  fx += growth.x;
  ny -= growth.y;
  fy += growth.y;
  nz -= growth.z;
  fz += growth.z;
#endif
  // The margin is that of ray_meets_boxes().
  const float near = fmax(fmax(nx, ny), fmax(nz, ray->t_min * 0.999999f));
  const float far = fmin(fmin(fx, fy), fmin(fz, t_end)) * 1.0000004f;
  return near <= far ? (as_uint(near) & ~3u) | lane : RS_NO_CHILD;
}

// The keys of a node's children, the nearest first. Two children at a time: all four would take
// most of the registers, and so would vectors of two, for which compilers keep every number of the
// ray twice.
RS_INLINE uint4 children_by_depth(const RayData* ray, __global const fv* node, const float t_end) {
  uint4 keys = (uint4)(RS_NO_CHILD);
#pragma unroll 1
  for (uint lane = 0; lane < LANES; lane += 2) {
    __global const float4* two = node + RS_NODE_VECTORS / 2 * (lane / 2);
    const float4 p = two[0], q = two[1], r = two[2];
    // Each to its place among those before it.
    const uint even = child_key(ray, p.xyz, (float3)(p.w, q.xy), t_end, lane);
    keys = min(keys, (uint4)(even, max(keys.xyz, even)));
    const uint odd = child_key(ray, (float3)(q.zw, r.x), r.yzw, t_end, lane + 1);
    keys = min(keys, (uint4)(odd, max(keys.xyz, odd)));
  }
  return keys;
}

RS_INLINE uint walk_next(
    TreeWalk* walk, const RayTree* tree, const RayData* ray, const float t_end, uint* first_block) {
  for (;;) {
    uint left = 0;
    if (walk->arrived) {
      const size_t node = (size_t)(tree->level_begin[walk->level] + walk->number);
#if COUNT_WORK
      ++walk->nodes;
#endif
      const uint4 keys = children_by_depth(ray, tree->nodes + node * RS_NODE_VECTORS, t_end);
      const uint4 lanes = (keys & 3u) + 1u;
      const uint4 met = select(lanes, (uint4)(0), keys == RS_NO_CHILD);
      left = met.x | met.y << 4 | met.z << 8 | met.w << 12;
      walk->arrived = false;
      if (walk->level == 1) {
        walk->children[1] = 0;
        if (left != 0) {
          *first_block = walk->number * LANES;
          const uint4 bits = ((uint4)(1) << met) >> 1;
          return bits.x | bits.y | bits.z | bits.w;
        }
      }
    } else {
      left = walk->children[walk->level];
    }
    while (left == 0) {
      if (walk->level == walk->root) {
        walk->children[walk->root] = 0;
        return 0;
      }
      ++walk->level;
      walk->number /= LANES;
      left = walk->children[walk->level];
    }
    walk->children[walk->level] = (ushort)(left >> 4);
    walk->number = walk->number * LANES + (left & 15) - 1;
    --walk->level;
    walk->arrived = true;
  }
}

#else

typedef struct {
  float entry[RS_NODE_STACK];
  uint node[RS_NODE_STACK];  // level in the lowest four bits
  int top;
  float here;  // entry of the node that walk_next() returned last
#if COUNT_WORK
  uint nodes;  // tested
#endif
} TreeWalk;

RS_INLINE void walk_begin(TreeWalk* walk, const RayTree* tree, const float t_min) {
  walk->top = tree->levels > 0 ? 1 : 0;
#if COUNT_WORK
  walk->nodes = 0;
#endif
  walk->entry[0] = t_min;
  walk->node[0] = (uint)tree->levels;
}

// No box that is still to be visited, nor one of the last node, begins before this.
float walk_bound(const TreeWalk* walk) {
  float bound = walk->here;
  for (int k = 0; k < walk->top; ++k) bound = fmin(bound, walk->entry[k]);
  return bound;
}

// Bits of the blocks, counted from *first_block, of the next node whose boxes the ray meets no
// farther than t_end; 0 when there is none left.
RS_INLINE uint walk_next(
    TreeWalk* walk, const RayTree* tree, const RayData* ray, const float t_end, uint* first_block) {
  while (walk->top > 0) {
    const int bottom = --walk->top;
    if (!(walk->entry[bottom] <= t_end)) continue;
    const uint level = walk->node[bottom] & 15, number = walk->node[bottom] >> 4;
    walk->here = walk->entry[bottom];
    RayLanes entry;
    const size_t node = (size_t)(tree->level_begin[level] + number);
#if COUNT_WORK
    ++walk->nodes;
#endif
    uint bits = ray_meets_boxes(ray, tree->nodes + node * RS_NODE_VECTORS, t_end, &entry.v);
    if (level == 1) {
      if (bits == 0) continue;
      *first_block = number * LANES;
      return bits;
    }
    for (; bits != 0; bits &= bits - 1) {
      const uint lane = rs_lowest_bit(bits);
      const float t = entry.s[lane];
      int j = walk->top++;
      for (; j > bottom && walk->entry[j - 1] < t; --j) {
        walk->entry[j] = walk->entry[j - 1];
        walk->node[j] = walk->node[j - 1];
      }
      walk->entry[j] = t;
      walk->node[j] = (number * LANES + lane) << 4 | (level - 1);
    }
  }
  return 0;
}

#endif

#endif
