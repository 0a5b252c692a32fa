// SPDX-License-Identifier: Apache-2.0
// Makes the implicit tree of lbvh_node.h over boxes in the order of curve.cl. All O(n).
//   order_groups   things of GROUP consecutive positions ordered again, so that blocks of PACKET
//                  get small boxes
//   merge_nodes    boxes of the nodes of one level
// What lies in the blocks is written by others, who also store the blocks' boxes in the nodes of
// level 1. A refit repeats that and merge_nodes. Splits by the surface area heuristic: Goldsmith
// and Salmon 1987, MacDonald and Booth 1990.
#include "bvh/lbvh_node.h"

// Boxes that order_groups orders together, a multiple of PACKET and at most 256.
#ifndef GROUP
#define GROUP 64
#endif
#define GROUP_BLOCKS (GROUP / PACKET)

float half_area(RsBox box) {
  const float4 e = max(box.hi - box.lo, 0.0f);
  return e.x * e.y + e.y * e.z + e.z * e.x;
}

// Positions g GROUP .. (g + 1) GROUP of `order` split again and again at a multiple of PACKET:
// along the axis and at the place where area times blocks of both sides is least. Launch: at least
// ceil(count / GROUP) work-items.
__kernel void order_groups(__global const RsAabb* boxes, __global uint* order, const uint count) {
  const uint begin = (uint)get_global_id(0) * GROUP;
  if (begin >= count) return;
  const int size = (int)min((uint)GROUP, count - begin);
  if (size <= PACKET) return;
  RsBox box[GROUP];
  uint index[GROUP];
  RsBox centers = box_empty();
  for (int i = 0; i < size; ++i) {
    index[i] = order[begin + i];
    box[i] = box_load_clean(boxes, index[i]);
    if (box[i].lo.x > box[i].hi.x) continue;
    RsBox center;
    center.lo = center.hi = box_center(box[i]);
    centers = box_union(centers, center);
  }
  // Along each axis the entries by centre: unique keys of 22 bits of position and the entry.
  uchar sorted[3][GROUP];
  union {
    iv v[GROUP_BLOCKS];
    int s[GROUP];
  } keys[3];
  const float4 extent = centers.hi - centers.lo;
  const float4 scale = extent > 1e-30f ? 4194303.0f / extent : 0.0f;
  for (int i = 0; i < GROUP; ++i) {
    int4 key = (int4)(0x7fffffff);
    if (i < size && box[i].lo.x <= box[i].hi.x) {
      key = convert_int4((box_center(box[i]) - centers.lo) * scale) << 8 | i;
    } else {
      key = 0x7fffff00 | i;
    }
    keys[0].s[i] = key.x;
    keys[1].s[i] = key.y;
    keys[2].s[i] = key.z;
  }
  for (int axis = 0; axis < 3; ++axis) {
    union {
      iv v;
      int s[PACKET];
    } rank;
    for (int j = 0; j < (size + PACKET - 1) / PACKET; ++j) {
      iv less = (iv)(0);
      const iv own = keys[axis].v[j];
      for (int i = 0; i < size; ++i) less -= RS_MASK((iv)(keys[axis].s[i]) < own);
      rank.v = less;
      for (int k = 0; k < PACKET && j * PACKET + k < size; ++k) {
        sorted[axis][rank.s[k]] = (uchar)(j * PACKET + k);
      }
    }
  }

  uchar stack_first[GROUP_BLOCKS], stack_blocks[GROUP_BLOCKS];  // in blocks
  int top = 1;
  stack_first[0] = 0;
  stack_blocks[0] = (uchar)((size + PACKET - 1) / PACKET);
  while (top > 0) {
    --top;
    const int first = stack_first[top];
    const int blocks = stack_blocks[top];
    if (blocks < 2) continue;
    const int start = first * PACKET;
    const int stop = min(start + blocks * PACKET, size);
    float best = INFINITY;
    int best_axis = 0, best_split = 1;
    for (int axis = 0; axis < 3; ++axis) {
      RsBox part[GROUP_BLOCKS];
      for (int b = 0; b < blocks; ++b) {
        RsBox sum = box_empty();
        const int last = min(start + (b + 1) * PACKET, stop);
        for (int i = start + b * PACKET; i < last; ++i) sum = box_union(sum, box[sorted[axis][i]]);
        part[b] = sum;
      }
      float behind[GROUP_BLOCKS];
      RsBox sum = part[blocks - 1];
      for (int b = blocks - 1; b > 0; --b) {
        sum = box_union(sum, part[b]);
        behind[b] = half_area(sum);
      }
      sum = part[0];
      for (int b = 1; b < blocks; ++b) {
        const float cost = half_area(sum) * b + behind[b] * (blocks - b);
        if (cost < best) {
          best = cost;
          best_axis = axis;
          best_split = b;
        }
        sum = box_union(sum, part[b]);
      }
    }
    const int border = start + best_split * PACKET;
    bool left[GROUP];
    for (int i = start; i < stop; ++i) left[sorted[best_axis][i]] = i < border;
    for (int axis = 0; axis < 3; ++axis) {
      if (axis == best_axis) continue;
      uchar right[GROUP];
      int to = start, rights = 0;
      for (int i = start; i < stop; ++i) {
        const uchar entry = sorted[axis][i];
        // Both are written, one counts: no branch.
        sorted[axis][to] = entry;
        right[rights] = entry;
        to += left[entry];
        rights += !left[entry];
      }
      for (int i = 0; i < rights; ++i) sorted[axis][to + i] = right[i];
    }
    stack_first[top] = (uchar)first;
    stack_blocks[top++] = (uchar)best_split;
    stack_first[top] = (uchar)(first + best_split);
    stack_blocks[top++] = (uchar)(blocks - best_split);
  }
  for (int i = 0; i < size; ++i) order[begin + i] = index[sorted[0][i]];
}

// Boxes of the `count` nodes from `source` into the lanes of the level above, which begins at
// `target`. Launch: at least `count` rounded up to a multiple of PACKET.
__kernel void merge_nodes(__global float* nodes,
                          const uint source,
                          const uint count,
                          const uint target) {
  const uint i = get_global_id(0);
  if (i >= (count + PACKET - 1) / PACKET * PACKET) return;
  RsBox sum = box_empty();
  if (i < count) {
    __global const float* from = nodes + (size_t)(source + i) * (RS_NODE_VECTORS * PACKET);
    for (int k = 0; k < PACKET; ++k, ++from) {
      RsBox child;
      child.lo = (float4)(from[0], from[PACKET], from[2 * PACKET], 0.0f);
      child.hi = (float4)(from[3 * PACKET], from[4 * PACKET], from[5 * PACKET], 0.0f);
      sum = box_union(sum, child);
    }
  }
  store_child(nodes, target + i / PACKET, i % PACKET, sum);
}
