// SPDX-License-Identifier: Apache-2.0
// order_leaves_group: what order_leaves does, with a work-group for every GROUP positions and a
// work-item for each: boxes and the three orders lie in local memory, every possible split is
// weighed by a work-item of its own, and all of them count where their entries go. O(GROUP) per
// work-item and level of splits. Launch: groups of GROUP work-items, ceil(count / GROUP) of them.
#include "bvh/order.h"

// Splits of an axis.
#define SPLITS (GROUP_BLOCKS - 1)

typedef struct {
  float lo[3][GROUP];
  float hi[3][GROUP];
  uint index[GROUP];
  int keys[3][GROUP];
  float cost[GROUP];
  uchar sorted[3][GROUP];      // entries by their centres along the axes, part by part
  uchar left[GROUP];           // whether an entry goes before the border
  uchar blocks[GROUP_BLOCKS];  // of the part that begins with a block
} OrderMemory;

RsBox entry_box(__local const OrderMemory* memory, int entry) {
  RsBox box;
  box.lo = (float4)(memory->lo[0][entry], memory->lo[1][entry], memory->lo[2][entry], 0.0f);
  box.hi = (float4)(memory->hi[0][entry], memory->hi[1][entry], memory->hi[2][entry], 0.0f);
  return box;
}

// Loads the boxes and sorts the entries along the axes.
void sort_entries(__global const RsAabb* boxes,
                  __global const uint* order,
                  int size,
                  __local OrderMemory* memory) {
  const int lane = get_local_id(0);
  RsBox box = box_empty();
  if (lane < size) {
    memory->index[lane] = order[lane];
    box = box_load_clean(boxes, order[lane]);
  }
  memory->lo[0][lane] = box.lo.x;
  memory->lo[1][lane] = box.lo.y;
  memory->lo[2][lane] = box.lo.z;
  memory->hi[0][lane] = box.hi.x;
  memory->hi[1][lane] = box.hi.y;
  memory->hi[2][lane] = box.hi.z;
  barrier(CLK_LOCAL_MEM_FENCE);
  RsBox centers = box_empty();
  for (int i = 0; i < size; ++i) centers = add_center(centers, entry_box(memory, i));
  const int4 key = order_keys(box, lane, centers, order_scale(centers));
  memory->keys[0][lane] = key.x;
  memory->keys[1][lane] = key.y;
  memory->keys[2][lane] = key.z;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (int axis = 0; axis < 3; ++axis) {
    const int own = memory->keys[axis][lane];
    int rank = 0;
    for (int i = 0; i < size; ++i) rank += memory->keys[axis][i] < own;
    if (lane < size) memory->sorted[axis][rank] = (uchar)lane;
  }
}

// What it costs to split the part of `blocks` blocks from position `start` to `stop`.
float split_cost(
    __local const OrderMemory* memory, int axis, int split, int blocks, int start, int stop) {
  const int border = start + split * LANES;
  RsBox before = box_empty(), behind = box_empty();
  for (int i = start; i < border; ++i) {
    before = box_union(before, entry_box(memory, memory->sorted[axis][i]));
  }
  for (int i = border; i < stop; ++i) {
    behind = box_union(behind, entry_box(memory, memory->sorted[axis][i]));
  }
  return half_area(before) * split + half_area(behind) * (blocks - split);
}

__attribute__((reqd_work_group_size(GROUP, 1, 1))) __kernel void order_leaves_group(
    __global const RsAabb* boxes, __global uint* order, const uint count) {
  __local OrderMemory memory;
  const int lane = get_local_id(0);
  const uint begin = (uint)get_group_id(0) * GROUP;
  const int size = (int)min((uint)GROUP, count - begin);
  if (size <= LANES) return;
  sort_entries(boxes, order + begin, size, &memory);
  const int all = (size + LANES - 1) / LANES;
  if (lane == 0) memory.blocks[0] = (uchar)all;
  barrier(CLK_LOCAL_MEM_FENCE);
  for (int first = 0;;) {
    while (first < all && memory.blocks[first] < 2) ++first;
    if (first >= all) break;
    const int blocks = memory.blocks[first];
    const int start = first * LANES;
    const int stop = min(start + blocks * LANES, size);
    const int own_axis = lane / SPLITS, own_split = lane % SPLITS + 1;
    memory.cost[lane] = own_axis < 3 && own_split < blocks
                            ? split_cost(&memory, own_axis, own_split, blocks, start, stop)
                            : INFINITY;
    barrier(CLK_LOCAL_MEM_FENCE);
    float best = INFINITY;
    int choice = 0;
    for (int i = 0; i < 3 * SPLITS; ++i) {
      const float cost = memory.cost[i];
      choice = cost < best ? i : choice;
      best = cost < best ? cost : best;
    }
    const int split = choice % SPLITS + 1;
    const int border = start + split * LANES;
    const bool inside = lane >= start && lane < stop;
    if (inside) memory.left[memory.sorted[choice / SPLITS][lane]] = lane < border;
    barrier(CLK_LOCAL_MEM_FENCE);
    // A stable partition along every axis; the chosen one stays as it is.
    uchar entry[3];
    int to[3];
    for (int axis = 0; axis < 3; ++axis) {
      int lefts = 0;
      for (int i = start; i < lane && inside; ++i) lefts += memory.left[memory.sorted[axis][i]];
      entry[axis] = memory.sorted[axis][lane];
      to[axis] = inside && memory.left[entry[axis]] ? start + lefts : border + lane - start - lefts;
    }
    barrier(CLK_LOCAL_MEM_FENCE);
    for (int axis = 0; axis < 3 && inside; ++axis) memory.sorted[axis][to[axis]] = entry[axis];
    if (lane == 0) {
      memory.blocks[first] = (uchar)split;
      memory.blocks[first + split] = (uchar)(blocks - split);
    }
    barrier(CLK_LOCAL_MEM_FENCE);
  }
  if (lane < size) order[begin + lane] = memory.index[memory.sorted[0][lane]];
}
