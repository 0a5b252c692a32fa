// SPDX-License-Identifier: Apache-2.0
// Things of GROUP consecutive positions ordered again, so that blocks of LANES get small boxes:
// positions g GROUP .. (g + 1) GROUP are split again and again at a multiple of LANES, along the
// axis and at the place where area times blocks of both sides is least. Splits by the surface area
// heuristic: Goldsmith and Salmon 1987, MacDonald and Booth 1990.
#ifndef RS_BVH_ORDER_H
#define RS_BVH_ORDER_H

#include "bvh/lbvh_node.h"

// A multiple of LANES and at most 256.
#ifndef GROUP
#define GROUP 64
#endif
#define GROUP_BLOCKS (GROUP / LANES)

float half_area(RsBox box) {
  const float4 e = max(box.hi - box.lo, 0.0f);
  return e.x * e.y + e.y * e.z + e.z * e.x;
}

// Keys of an entry along the axes, all different: 22 bits of the centre's position and the entry.
// `scale` is order_scale of all centres.
int4 order_keys(RsBox box, int entry, RsBox centers, float4 scale) {
  if (box.lo.x > box.hi.x) return (int4)(0x7fffff00 | entry);
  return convert_int4((box_center(box) - centers.lo) * scale) << 8 | entry;
}

float4 order_scale(RsBox centers) {
  const float4 extent = centers.hi - centers.lo;
  return extent > 1e-30f ? 4194303.0f / extent : 0.0f;
}

// `sum` with the centre of a box that is not empty.
RsBox add_center(RsBox sum, RsBox box) {
  if (box.lo.x > box.hi.x) return sum;
  RsBox center;
  center.lo = center.hi = box_center(box);
  return box_union(sum, center);
}

#endif
