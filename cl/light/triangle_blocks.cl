// SPDX-License-Identifier: Apache-2.0
// The leaves of the tree over triangles: triangle_bounds makes the boxes that the tree is built
// over, fill_triangles the blocks of triangle_block.h in the tree's order and their boxes. Launch:
// one work-item per triangle or block. Cost: O(1) each.
#include "light/triangle_block.h"

// corners: three positions of three floats per triangle.
__kernel void triangle_bounds(__global const float* restrict corners,
                              const uint count,
                              __global RsAabb* restrict boxes) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  __global const float* p = corners + 9 * (size_t)i;
  RsBox box;
  box.lo = box.hi = (float4)(p[0], p[1], p[2], 0.0f);
  for (int k = 1; k < 3; ++k) {
    RsBox corner;
    corner.lo = corner.hi = (float4)(p[3 * k], p[3 * k + 1], p[3 * k + 2], 0.0f);
    box = box_union(box, corner);
  }
  box_store(box, boxes, i);
}

// Lanes of nodes without a block become empty boxes: `padded_blocks` is a multiple of LANES.
__kernel void fill_triangles(const uint count,
                             const uint padded_blocks,
                             __global const uint* restrict order,
                             __global const RsAabb* restrict boxes,
                             __global const float* restrict corners,
                             __global float* restrict blocks,
                             __global float* restrict nodes) {
  const uint block = get_global_id(0);
  if (block >= padded_blocks) return;
  RsBox sum = box_empty();
  for (uint lane = 0; lane < LANES && (size_t)block * LANES < count; ++lane) {
    const size_t slot = (size_t)block * LANES + lane;
    __global float* record = blocks + (size_t)block * (RS_TRIANGLE_VECTORS * LANES);
    const bool present = slot < count;
    const uint index = present ? order[slot] : 0;
    if (present) sum = box_union(sum, box_load_clean(boxes, index));
    for (int k = 0; k < 9; ++k)
      record[RS_TRIANGLE_FLOAT(k, lane)] = present ? corners[9 * (size_t)index + k] : NAN;
    record[RS_TRIANGLE_FLOAT(RS_TRIANGLE_INDEX, lane)] = as_float(present ? index : 0xffffffffu);
  }
  store_child(nodes, block / LANES, block % LANES, sum);
}
