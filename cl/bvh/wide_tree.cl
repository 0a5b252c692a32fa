// SPDX-License-Identifier: Apache-2.0
// Builds the implicit tree of wide_node.h over boxes. All O(n).
//   bound_centers  box of the centres in chunks, then finish_grid: the curve's cells
//   hilbert_codes  position of every box's centre on a Hilbert curve
//   order_groups   after a sort by code: things of GROUP consecutive positions ordered again, so
//                  that blocks of PACKET get small boxes
//   merge_nodes    boxes of the nodes of one level
// What lies in the blocks is written by others, who also store the blocks' boxes in the nodes of
// level 1. A refit repeats that and merge_nodes. Hilbert codes by transposed axes: Skilling 2004.
// Splits by the surface area heuristic: Goldsmith and Salmon 1987, MacDonald and Booth 1990.
#include "bvh/wide_node.h"

// Boxes that order_groups orders together, a multiple of PACKET and at most 256.
#ifndef GROUP
#define GROUP 64
#endif
#define GROUP_BLOCKS (GROUP / PACKET)
#define CODE_BITS 21
#define RS_LAST_CELL 2097151.0f

// partials[g] = box of the centres of the valid boxes in chunk g. Launch: one work-item per chunk.
__kernel void bound_centers(__global const RsAabb* boxes,
                            __global RsAabb* partials,
                            const uint count,
                            const uint chunk) {
  const uint begin = min((uint)get_global_id(0) * chunk, count);
  const uint end = min(begin + chunk, count);
  RsBox sum = box_empty();
  for (uint i = begin; i < end; ++i) {
    const RsBox box = box_load(boxes, i);
    if (!box_valid(box)) continue;
    RsBox center;
    center.lo = center.hi = box_center(box);
    sum = box_union(sum, center);
  }
  box_store(sum, partials, get_global_id(0));
}

// grid = {half the origin (3), cells per half unit}: one cell size for all axes, so that the curve
// keeps its shape. Launch: one work-item.
__kernel void finish_grid(__global const RsAabb* partials, const uint count, __global float* grid) {
  RsBox sum = box_empty();
  for (uint i = 0; i < count; ++i) sum = box_union(sum, box_load(partials, i));
  const float4 extent = 0.5f * sum.hi - 0.5f * sum.lo;
  const float longest = fmax(extent.x, fmax(extent.y, extent.z));
  const bool flat = !(longest > 1e-30f);
  vstore3(flat ? (float3)(0.0f) : 0.5f * sum.lo.xyz, 0, grid);
  grid[3] = flat ? 0.0f : RS_LAST_CELL / longest;
}

// The 21 low bits of x, two zeros after each.
ulong spread_bits(uint x) {
  ulong v = x & 0x1fffff;
  v = (v | v << 32) & 0x001f00000000ffffUL;
  v = (v | v << 16) & 0x001f0000ff0000ffUL;
  v = (v | v << 8) & 0x100f00f00f00f00fUL;
  v = (v | v << 4) & 0x10c30c30c30c30c3UL;
  v = (v | v << 2) & 0x1249249249249249UL;
  return v;
}

// high (31 bits), low (32 bits) = code of box i, indices[i] = i. Boxes that are not valid come
// last. Launch: at least ceil(count / PACKET) work-items, PACKET boxes
// each.
__kernel void hilbert_codes(__global const RsAabb* boxes,
                            __global const float* grid,
                            __global uint* high,
                            __global uint* low,
                            __global uint* indices,
                            const uint count) {
  const uint begin = (uint)get_global_id(0) * PACKET;
  if (begin >= count) return;
  const uint size = min((uint)PACKET, count - begin);
  union {
    iv v[3];
    int s[3][PACKET];
  } cell;
  bool valid[PACKET];
  for (uint k = 0; k < PACKET; ++k) {
    const RsBox box = box_load(boxes, begin + min(k, size - 1));
    valid[k] = box_valid(box);
    const float4 at =
        clamp((0.5f * box_center(box) - vload4(0, grid)) * grid[3], 0.0f, RS_LAST_CELL);
    cell.s[0][k] = valid[k] ? (int)at.x : 0;
    cell.s[1][k] = valid[k] ? (int)at.y : 0;
    cell.s[2][k] = valid[k] ? (int)at.z : 0;
  }
  iv x = cell.v[0], y = cell.v[1], z = cell.v[2];
  for (int bit = 1 << (CODE_BITS - 1); bit > 1; bit >>= 1) {
    const iv low_bits = (iv)(bit - 1);
    x ^= low_bits & RS_MASK((x & bit) != 0);
    const iv flip_y = RS_MASK((y & bit) != 0);
    iv swap = (x ^ y) & low_bits & ~flip_y;
    x ^= (low_bits & flip_y) | swap;
    y ^= swap;
    const iv flip_z = RS_MASK((z & bit) != 0);
    swap = (x ^ z) & low_bits & ~flip_z;
    x ^= (low_bits & flip_z) | swap;
    z ^= swap;
  }
  y ^= x;
  z ^= y;
  iv parity = (iv)(0);
  for (int bit = 1 << (CODE_BITS - 1); bit > 1; bit >>= 1) {
    parity ^= (iv)(bit - 1) & RS_MASK((z & bit) != 0);
  }
  cell.v[0] = x ^ parity;
  cell.v[1] = y ^ parity;
  cell.v[2] = z ^ parity;
  for (uint k = 0; k < size; ++k) {
    const ulong code = valid[k] ? spread_bits(cell.s[0][k]) << 2 | spread_bits(cell.s[1][k]) << 1 |
                                      spread_bits(cell.s[2][k])
                                : 0x7fffffffffffffffUL;
    high[begin + k] = (uint)(code >> 32);
    low[begin + k] = (uint)code;
    indices[begin + k] = begin + k;
  }
}

// keys[i] = words[order[i]]. Launch: at least count work-items.
__kernel void gather_codes(__global const uint* words,
                           __global const uint* order,
                           __global uint* keys,
                           const uint count) {
  const uint i = get_global_id(0);
  if (i < count) keys[i] = words[order[i]];
}

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
