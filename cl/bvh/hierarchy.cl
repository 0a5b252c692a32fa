// SPDX-License-Identifier: Apache-2.0
// Hierarchy and bounds over sorted Morton codes (Karras 2012: the binary radix tree of the codes,
// ties broken by position; node numbers as there: a left child's number is its last leaf, a right
// child's its first). No atomics and no order between work-items: each node is written by exactly
// one of them.
//
// Every inner node belongs to one split, the pair of neighbours (i, i + 1) it separates. delta[i]
// is the length of their common prefix. A node whose leaves lie in one chunk is made by
// build_chunks in a single sequential walk with a stack, O(1) per node (the Cartesian tree of
// delta, after Vuillemin 1980). Nodes across chunks are found by binary search (find_spanning),
// O(log n), and bounded from an implicit binary tree of boxes over blocks of RS_BLOCK leaves
// (merge_blocks, bound_spanning), O(RS_BLOCK + log n). Few long chunks suit CPUs; without chunks
// (bound_blocks instead of build_chunks) every node takes the second way, which suits GPUs. The
// result is the same.
#include "bvh/box.h"
#include "primitives/prefetch.h"

#ifndef RS_BLOCK
#define RS_BLOCK 16
#endif
// 64 prefix lengths of codes and 31 of positions: no stack of increasing deltas is longer.
#define RS_STACK 96
// Leaves between a box's use and its fetch.
#define RS_AHEAD (2 * RS_BLOCK)
// States of spanning[i]: to be found, made by build_chunks, else node number + 1.
#define RS_PENDING 0u
#define RS_DONE 0xffffffffu

// Length of the common prefix of the codes at two different positions; `low` is in the order of the
// boxes.
inline int common_prefix(__global const uint* high,
                         __global const uint* low,
                         __global const uint* leaves,
                         uint i,
                         uint j) {
  const uint x = high[i] ^ high[j];
  if (x != 0) return (int)clz(x);
  const uint y = low[leaves[i]] ^ low[leaves[j]];
  return y != 0 ? 32 + (int)clz(y) : 64 + (int)clz(i ^ j);
}

// delta[i] for i < count - 1. Launch: work-items of `chunk` consecutive splits each.
__kernel void compute_deltas(__global const uint* high,
                             __global const uint* low,
                             __global const uint* leaves,
                             __global uchar* delta,
                             uint count,
                             uint chunk) {
  const uint begin = (uint)get_global_id(0) * chunk;
  const uint end = min(begin + chunk, count - 1);
  for (uint i = begin; i < end; ++i) {
    delta[i] = (uchar)common_prefix(high, low, leaves, i, i + 1);
  }
}

inline int delta_before(__global const uchar* delta, uint first) {
  return first > 0 ? delta[first - 1] : -1;
}

inline int delta_after(__global const uchar* delta, uint last, uint count) {
  return last + 1 < count ? delta[last] : -1;
}

// The number of the node over first..last: its parent splits on the side with the longer prefix.
inline uint node_number(int before, int after, uint first, uint last) {
  return before >= after ? first : last;
}

// References to the children of the node over first..last split after `split`, and the range.
inline int4 node_links(uint first, uint split, uint last) {
  return (int4)(first == split ? ~(int)split : (int)split,
                last == split + 1 ? ~(int)last : (int)(split + 1), (int)first, (int)last);
}

inline void store_bounds(__global RsBvhNode* node, RsBox left, RsBox right) {
  __global float* p = (__global float*)node;
  vstore4((float4)(left.lo.xyz, left.hi.x), 0, p);
  vstore4((float4)(left.hi.yz, right.lo.xy), 1, p);
  vstore4((float4)(right.lo.z, right.hi.xyz), 2, p);
}

// Makes every node whose leaves lie in the work-item's chunk and the boxes of its leaf blocks. With
// `refit` the states of the splits stay as they are. Launch: one work-item per chunk, a multiple of
// RS_BLOCK leaves.
__kernel void build_chunks(__global const RsAabb* boxes,
                           __global const uint* leaves,
                           __global const uchar* delta,
                           __global RsBvhNode* nodes,
                           __global uint* spanning,
                           __global RsAabb* blocks,
                           uint count,
                           uint chunk,
                           int refit) {
  const uint begin = (uint)get_global_id(0) * chunk;
  const uint end = min(begin + chunk, count);
  RsBox stack_box[RS_STACK];
  uint stack_first[RS_STACK];
  int stack_delta[RS_STACK];  // prefix length behind the entry's last leaf
  int depth = 0;
  for (uint block = begin; block < end; block += RS_BLOCK) {
    const uint size = min((uint)RS_BLOCK, end - block);
    // The boxes lie anywhere: those of a later block are fetched now, with the nodes that will be
    // written near their leaves, and the loads of a block come before what waits for them.
    const uint ahead = block + RS_AHEAD;
    for (uint i = ahead; i < min(ahead + RS_BLOCK, end); ++i) {
      RS_PREFETCH_READ(boxes[leaves[i]].lo);
      RS_PREFETCH_READ(boxes[leaves[i]].hi + 2);
      RS_PREFETCH_WRITE(nodes + i);
    }
    RsBox leaf[RS_BLOCK];
    RsBox sum = box_empty();
    for (uint k = 0; k < size; ++k) {
      leaf[k] = box_load_clean(boxes, leaves[block + k]);
      sum = box_union(sum, leaf[k]);
    }
    box_store(sum, blocks, block / RS_BLOCK);
    for (uint k = 0; k < size; ++k) {
      const uint i = block + k;
      const int after = delta_after(delta, i, count);
      RsBox box = leaf[k];
      uint first = i;
      while (depth > 0 && stack_delta[depth - 1] > after) {
        --depth;
        const uint split = first - 1;
        const uint left_first = stack_first[depth];
        const RsBox left = stack_box[depth];
        __global RsBvhNode* node =
            nodes + node_number(delta_before(delta, left_first), after, left_first, i);
        store_bounds(node, left, box);
        vstore4(node_links(left_first, split, i), 3, (__global int*)node);
        if (!refit) spanning[split] = RS_DONE;
        box = box_union(left, box);
        first = left_first;
      }
      if (!refit && i + 1 < count) spanning[i] = RS_PENDING;
      // With nothing on the stack to join and the longer prefix on the left, the parent spans the
      // chunk's border.
      if (depth > 0 || delta_before(delta, first) <= after) {
        stack_box[depth] = box;
        stack_first[depth] = first;
        stack_delta[depth] = after;
        ++depth;
      }
    }
  }
}

// blocks[b] = box of leaf block b. Launch: at least as many work-items as blocks.
__kernel void bound_blocks(__global const RsAabb* boxes,
                           __global const uint* leaves,
                           __global RsAabb* blocks,
                           uint count) {
  const uint begin = (uint)get_global_id(0) * RS_BLOCK;
  if (begin >= count) return;
  const uint end = min(begin + RS_BLOCK, count);
  RsBox sum = box_empty();
  for (uint i = begin; i < end; ++i) sum = box_union(sum, box_load_clean(boxes, leaves[i]));
  box_store(sum, blocks, get_global_id(0));
}

// One level of the tree over blocks: boxes [source, source + size) pairwise into [target, ...).
// Launch: at least (size + 1) / 2 work-items.
__kernel void merge_blocks(__global RsAabb* blocks, uint source, uint size, uint target) {
  const uint i = get_global_id(0);
  if (2 * i >= size) return;
  RsBox box = box_load(blocks, source + 2 * i);
  if (2 * i + 1 < size) box = box_union(box, box_load(blocks, source + 2 * i + 1));
  box_store(box, blocks, target + i);
}

// Links of the nodes of all pending splits. Launch: work-items of `chunk` consecutive splits each.
__kernel void find_spanning(__global const uint* high,
                            __global const uint* low,
                            __global const uint* leaves,
                            __global const uchar* delta,
                            __global RsBvhNode* nodes,
                            __global uint* spanning,
                            uint count,
                            uint chunk) {
  const uint begin = (uint)get_global_id(0) * chunk;
  const uint end = min(begin + chunk, count - 1);
  for (uint split = begin; split < end; ++split) {
    if (spanning[split] != RS_PENDING) continue;
    const int length = delta[split];
    // The node is the longest range around the split that shares the prefix.
    uint step = 1;
    while (step <= split && common_prefix(high, low, leaves, split, split - step) >= length) {
      step *= 2;
    }
    uint reach = 0;
    for (; step > 0; step /= 2) {
      if (reach + step <= split &&
          common_prefix(high, low, leaves, split, split - reach - step) >= length) {
        reach += step;
      }
    }
    const uint first = split - reach;
    const uint next = split + 1;
    step = 1;
    while (step < count - next && common_prefix(high, low, leaves, next, next + step) >= length) {
      step *= 2;
    }
    reach = 0;
    for (; step > 0; step /= 2) {
      if (reach + step < count - next &&
          common_prefix(high, low, leaves, next, next + reach + step) >= length) {
        reach += step;
      }
    }
    const uint last = next + reach;
    const uint number =
        node_number(delta_before(delta, first), delta_after(delta, last, count), first, last);
    vstore4(node_links(first, split, last), 3, (__global int*)(nodes + number));
    spanning[split] = number + 1;
  }
}

// Box of the leaves first..last from whole blocks and single leaves.
inline RsBox range_box(__global const RsAabb* boxes,
                       __global const uint* leaves,
                       __global const RsAabb* blocks,
                       uint count,
                       uint first,
                       uint last) {
  RsBox sum = box_empty();
  uint begin = (first + RS_BLOCK - 1) / RS_BLOCK;
  uint end = (last + 1) / RS_BLOCK;
  if (last + 1 == count) end = (count + RS_BLOCK - 1) / RS_BLOCK;  // the last block may be short
  if (begin >= end) {
    for (uint i = first; i <= last; ++i) sum = box_union(sum, box_load_clean(boxes, leaves[i]));
    return sum;
  }
  for (uint i = first; i < begin * RS_BLOCK; ++i) {
    sum = box_union(sum, box_load_clean(boxes, leaves[i]));
  }
  for (uint i = end * RS_BLOCK; i <= last; ++i) {
    sum = box_union(sum, box_load_clean(boxes, leaves[i]));
  }
  uint level = 0;
  for (uint size = (count + RS_BLOCK - 1) / RS_BLOCK; begin < end; size = (size + 1) / 2) {
    if (begin & 1) sum = box_union(sum, box_load(blocks, level + begin++));
    if (end & 1) sum = box_union(sum, box_load(blocks, level + --end));
    begin /= 2;
    end /= 2;
    level += size;
  }
  return sum;
}

// Bounds of the nodes that find_spanning linked. Launch: work-items of `chunk` consecutive splits
// each.
__kernel void bound_spanning(__global const RsAabb* boxes,
                             __global const uint* leaves,
                             __global const RsAabb* blocks,
                             __global const uint* spanning,
                             __global RsBvhNode* nodes,
                             uint count,
                             uint chunk) {
  const uint begin = (uint)get_global_id(0) * chunk;
  const uint end = min(begin + chunk, count - 1);
  for (uint split = begin; split < end; ++split) {
    const uint state = spanning[split];
    if (state == RS_DONE) continue;
    __global RsBvhNode* node = nodes + (state - 1);
    const RsBox left = range_box(boxes, leaves, blocks, count, (uint)node->first, split);
    const RsBox right = range_box(boxes, leaves, blocks, count, split + 1, (uint)node->last);
    store_bounds(node, left, right);
  }
}
