// SPDX-License-Identifier: Apache-2.0
// What a tree costs to walk, after the surface-area heuristic (Goldsmith and Salmon 1987): the
// areas of the boxes of all nodes and blocks (sum_node_areas) and of what the tree is over
// (sum_box_areas), each clipped to the window of the grid (curve.cl), so that a few far boxes do
// not hide what happens among the others. Launch: groups of GROUP work-items (1 or a power of
// two), each group walks `chunk` consecutive nodes or boxes and writes one sum. Reads everything
// once: bound by memory.
#include "bvh/lbvh_node.h"

#ifndef GROUP
#define GROUP 1
#endif
// What is summed before it is added to the sum of all: keeps float sums exact enough.
#define RS_RUN 256

// Half the area of what lies in the window, of LANES boxes or of one; 0 for empty boxes.
#define RS_CLIPPED_SIDE(lo, hi, axis) \
  (min((hi), 2.0f * window[11 + (axis)]) - max((lo), 2.0f * window[8 + (axis)]))

// The sum over a group; the result is that of its first work-item.
float group_sum(float own, __local float* scratch) {
#if GROUP > 1
  const uint lane = get_local_id(0);
  scratch[lane] = own;
  for (uint half_size = GROUP / 2; half_size > 0; half_size /= 2) {
    barrier(CLK_LOCAL_MEM_FENCE);
    if (lane < half_size) {
      own += scratch[lane + half_size];
      scratch[lane] = own;
    }
  }
#else
  (void)scratch;
#endif
  return own;
}

float box_area(const RsBox box, __global const float* window) {
  const float x = RS_CLIPPED_SIDE(box.lo.x, box.hi.x, 0);
  const float y = RS_CLIPPED_SIDE(box.lo.y, box.hi.y, 1);
  const float z = RS_CLIPPED_SIDE(box.lo.z, box.hi.z, 2);
  const float area = x * y + y * z + z * x;
  return x >= 0.0f && y >= 0.0f && z >= 0.0f && area <= FLT_MAX ? area : 0.0f;
}

float node_area(__global const fv* node, __global const float* window) {
#if TRAIL
  float sum = 0.0f;
  for (uint k = 0; k < LANES; ++k)
    sum += box_area(load_child((__global const float*)node, 0, k), window);
  return sum;
#else
  const fv x = RS_CLIPPED_SIDE(node[0], node[3], 0);
  const fv y = RS_CLIPPED_SIDE(node[1], node[4], 1);
  const fv z = RS_CLIPPED_SIDE(node[2], node[5], 2);
  const fv area = x * y + y * z + z * x;
  const iv counts =
      RS_MASK(x >= 0.0f) & RS_MASK(y >= 0.0f) & RS_MASK(z >= 0.0f) & RS_MASK(area <= FLT_MAX);
  return rs_lane_sum(select((fv)(0.0f), area, counts));
#endif
}

// `window` is the grid that choose_grid made.
__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void sum_node_areas(
    __global const fv* nodes,
    __global const float* window,
    __global float* sums,
    uint count,
    uint chunk) {
  __local float scratch[GROUP];
  const uint begin = min((uint)get_group_id(0) * chunk, count);
  const uint end = min(begin + chunk, count);
  float sum = 0.0f;
  for (uint run = begin; run < end; run += RS_RUN * GROUP) {
    float part = 0.0f;
    for (uint i = run + get_local_id(0); i < min(run + RS_RUN * GROUP, end); i += GROUP)
      part += node_area(nodes + (size_t)i * RS_NODE_VECTORS, window);
    sum += part;
  }
  sum = group_sum(sum, scratch);
  if (get_local_id(0) == 0) sums[get_group_id(0)] = sum;
}

__kernel __attribute__((reqd_work_group_size(GROUP, 1, 1))) void sum_box_areas(
    __global const RsAabb* boxes,
    __global const float* window,
    __global float* sums,
    uint count,
    uint chunk) {
  __local float scratch[GROUP];
  const uint begin = min((uint)get_group_id(0) * chunk, count);
  const uint end = min(begin + chunk, count);
  float sum = 0.0f;
  for (uint run = begin; run < end; run += RS_RUN * GROUP) {
    float part = 0.0f;
    for (uint i = run + get_local_id(0); i < min(run + RS_RUN * GROUP, end); i += GROUP)
      part += box_area(box_load(boxes, i), window);
    sum += part;
  }
  sum = group_sum(sum, scratch);
  if (get_local_id(0) == 0) sums[get_group_id(0)] = sum;
}
