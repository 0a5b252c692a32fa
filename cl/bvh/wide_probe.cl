// SPDX-License-Identifier: Apache-2.0
// meet_node: which children of one node (bvh/wide_node.h) each ray meets, one bit each, so that the
// tests see the box test alone. rays: origin, t_min, direction, t_max. Any local size.
#include "bvh/wide_node.h"

__kernel void meet_node(const uint count,
                        __global const float8* restrict rays,
                        __global const fv* restrict node,
                        __global uint* restrict met) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  const float8 raw = rays[i];
  const RayData ray = ray_data(raw);
  fv entry;
  met[i] = ray_meets_boxes(&ray, node, raw.s7, &entry);
}
