// SPDX-License-Identifier: Apache-2.0
// order_leaves: orders groups again (order.h), a work-item each. Launch: at least ceil(count /
// GROUP) work-items. On GPUs: leaf_order_group.cl.
#include "bvh/order.h"

__kernel void order_leaves(__global const RsAabb* boxes, __global uint* order, const uint count) {
  const uint begin = (uint)get_global_id(0) * GROUP;
  if (begin >= count) return;
  const int size = (int)min((uint)GROUP, count - begin);
  if (size <= LANES) return;
  RsBox box[GROUP];
  uint index[GROUP];
  RsBox centers = box_empty();
  for (int i = 0; i < size; ++i) {
    index[i] = order[begin + i];
    box[i] = box_load_clean(boxes, index[i]);
    centers = add_center(centers, box[i]);
  }
  // Along each axis the entries by centre.
  uchar sorted[3][GROUP];
  union {
    iv v[GROUP_BLOCKS];
    int s[GROUP];
  } keys[3];
  const float4 scale = order_scale(centers);
  for (int i = 0; i < GROUP; ++i) {
    const int4 key = order_keys(i < size ? box[i] : box_empty(), i, centers, scale);
    keys[0].s[i] = key.x;
    keys[1].s[i] = key.y;
    keys[2].s[i] = key.z;
  }
  for (int axis = 0; axis < 3; ++axis) {
    union {
      iv v;
      int s[LANES];
    } rank;
    for (int j = 0; j < (size + LANES - 1) / LANES; ++j) {
      iv less = (iv)(0);
      const iv own = keys[axis].v[j];
      for (int i = 0; i < size; ++i) less -= RS_MASK((iv)(keys[axis].s[i]) < own);
      rank.v = less;
      for (int k = 0; k < LANES && j * LANES + k < size; ++k) {
        sorted[axis][rank.s[k]] = (uchar)(j * LANES + k);
      }
    }
  }

  uchar stack_first[GROUP_BLOCKS], stack_blocks[GROUP_BLOCKS];  // in blocks
  int top = 1;
  stack_first[0] = 0;
  stack_blocks[0] = (uchar)((size + LANES - 1) / LANES);
  while (top > 0) {
    --top;
    const int first = stack_first[top];
    const int blocks = stack_blocks[top];
    if (blocks < 2) continue;
    const int start = first * LANES;
    const int stop = min(start + blocks * LANES, size);
    float best = INFINITY;
    int best_axis = 0, best_split = 1;
    for (int axis = 0; axis < 3; ++axis) {
      RsBox part[GROUP_BLOCKS];
      for (int b = 0; b < blocks; ++b) {
        RsBox sum = box_empty();
        const int last = min(start + (b + 1) * LANES, stop);
        for (int i = start + b * LANES; i < last; ++i) sum = box_union(sum, box[sorted[axis][i]]);
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
    const int border = start + best_split * LANES;
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
