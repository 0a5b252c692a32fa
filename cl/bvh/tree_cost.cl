// SPDX-License-Identifier: Apache-2.0
// What a tree costs to walk, after the surface-area heuristic (Goldsmith and Salmon 1987): the area
// of the boxes of inner nodes and of leaves. Launch: groups of RS_GROUP work-items (1 or a power of
// two), each walks `chunk` consecutive nodes. Reads every node once: bound by memory.
#include "shared/layout.h"

#ifndef RS_GROUP
#define RS_GROUP 1
#endif
// Nodes whose areas are summed before they are added to the sum of all: keeps float sums exact
// enough.
#define RS_RUN 256

// Half the area; 0 for an empty box and where it overflows.
inline float half_area(float4 lo, float4 hi) {
  const float4 side = hi - lo;
  const float area = side.x * side.y + side.y * side.z + side.z * side.x;
  return side.x >= 0.0f && side.y >= 0.0f && side.z >= 0.0f && area <= FLT_MAX ? area : 0.0f;
}

// sums[group] = {area of the children that are inner nodes, of those that are leaves}, halves.
__kernel __attribute__((reqd_work_group_size(RS_GROUP, 1, 1))) void sum_areas(
    __global const RsBvhNode* nodes, __global float2* sums, uint count, uint chunk) {
  const uint begin = min((uint)get_group_id(0) * chunk, count);
  const uint end = min(begin + chunk, count);
  float2 sum = (float2)(0.0f);
  for (uint run = begin; run < end; run += RS_RUN * RS_GROUP) {
    const uint stop = min(run + RS_RUN * RS_GROUP, end);
    float2 part = (float2)(0.0f);
    for (uint i = run + get_local_id(0); i < stop; i += RS_GROUP) {
      __global const float* p = (__global const float*)(nodes + i);
      const float4 a = vload4(0, p);
      const float4 b = vload4(1, p);
      const float4 c = vload4(2, p);
      const float left = half_area(a, (float4)(a.w, b.xy, 0.0f));
      const float right = half_area((float4)(b.zw, c.x, 0.0f), c.yzww);
      part.x += (nodes[i].left < 0 ? 0.0f : left) + (nodes[i].right < 0 ? 0.0f : right);
      part.y += (nodes[i].left < 0 ? left : 0.0f) + (nodes[i].right < 0 ? right : 0.0f);
    }
    sum += part;
  }
#if RS_GROUP > 1
  __local float2 scratch[RS_GROUP];
  const uint lane = get_local_id(0);
  scratch[lane] = sum;
  for (uint half_size = RS_GROUP / 2; half_size > 0; half_size /= 2) {
    barrier(CLK_LOCAL_MEM_FENCE);
    if (lane < half_size) {
      sum += scratch[lane + half_size];
      scratch[lane] = sum;
    }
  }
#endif
  if (get_local_id(0) == 0) sums[get_group_id(0)] = sum;
}
