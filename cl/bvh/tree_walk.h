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

// The lanes of `bits` by their depths, which are not negative: the two lowest bits of each give way
// to the lane.
RS_INLINE uint lanes_by_depth(const uint bits, const fv depth) {
  uint4 key = (as_uint4(depth) & ~3u) | (uint4)(0, 1, 2, 3);
  key = select(key, (uint4)(0xffffffffu), (uint4)(bits & 1, bits & 2, bits & 4, bits & 8) == 0);
  const uint2 low = min(key.xy, key.zw), high = max(key.xy, key.zw);
  const uint first = min(low.x, low.y), last = max(high.x, high.y);
  const uint a = max(low.x, low.y), b = min(high.x, high.y);
  const uint second = min(a, b), third = max(a, b);
  uint out = first == 0xffffffffu ? 0 : (first & 3) + 1;
  out |= second == 0xffffffffu ? 0 : ((second & 3) + 1) << 4;
  out |= third == 0xffffffffu ? 0 : ((third & 3) + 1) << 8;
  return out | (last == 0xffffffffu ? 0 : ((last & 3) + 1) << 12);
}

RS_INLINE uint walk_next(
    TreeWalk* walk, const RayTree* tree, const RayData* ray, const float t_end, uint* first_block) {
  for (;;) {
    uint left = 0;
    if (walk->arrived) {
      const size_t node = (size_t)(tree->level_begin[walk->level] + walk->number);
      fv depth;
#if COUNT_WORK
      ++walk->nodes;
#endif
      const uint bits = ray_meets_boxes(ray, tree->nodes + node * RS_NODE_VECTORS, t_end, &depth);
      walk->arrived = false;
      if (walk->level == 1) {
        walk->children[1] = 0;
        if (bits != 0) {
          *first_block = walk->number * LANES;
          return bits;
        }
      } else {
        left = lanes_by_depth(bits, depth);
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
