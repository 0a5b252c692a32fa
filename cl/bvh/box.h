// SPDX-License-Identifier: Apache-2.0
// Boxes in registers. The fourth lane is unused. Minimum and maximum are selections, so that they
// compile to one vector instruction and give the same bits everywhere.
#ifndef RS_BVH_BOX_H
#define RS_BVH_BOX_H

#include "shared/layout.h"

typedef struct {
  float4 lo;
  float4 hi;
} RsBox;

// Finite on purpose: slab tests with it give no NaN, box tests with its centre and extent fail.
RsBox box_empty(void) {
  RsBox box;
  box.lo = (float4)(FLT_MAX);
  box.hi = (float4)(-FLT_MAX);
  return box;
}

RsBox box_union(RsBox a, RsBox b) {
  RsBox box;
  box.lo = a.lo < b.lo ? a.lo : b.lo;
  box.hi = a.hi > b.hi ? a.hi : b.hi;
  return box;
}

RsBox box_load(__global const RsAabb* boxes, size_t index) {
  __global const float* p = (__global const float*)(boxes + index);
  RsBox box;
  box.lo = vload4(0, p);
  box.hi = vload4(0, p + 2).yzww;
  box.lo.w = 0.0f;
  box.hi.w = 0.0f;
  return box;
}

// False for an empty box and for one with a NaN or an infinity.
bool box_valid(RsBox box) {
  return all(box.lo <= box.hi && box.lo >= (float4)(-FLT_MAX) && box.hi <= (float4)(FLT_MAX));
}

// Anything but a valid box becomes the empty one.
RsBox box_load_clean(__global const RsAabb* boxes, size_t index) {
  const RsBox box = box_load(boxes, index);
  return box_valid(box) ? box : box_empty();
}

void box_store(RsBox box, __global RsAabb* boxes, size_t index) {
  __global float* p = (__global float*)(boxes + index);
  vstore3(box.lo.xyz, 0, p);
  vstore3(box.hi.xyz, 1, p);
}

// Halves first: no finite box overflows.
float4 box_center(RsBox box) { return 0.5f * box.lo + 0.5f * box.hi; }

#endif
