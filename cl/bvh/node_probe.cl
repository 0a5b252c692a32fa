// SPDX-License-Identifier: Apache-2.0
// For tests of the tree alone (lbvh_node.h).
//   meet_node    which children of one node each ray meets, one bit each. Any local size
//   box_blocks   what an owner of the tree does, for blocks that hold nothing: their boxes into the
//                nodes of level 1. Launch: at least `padded_blocks` work-items
#include "bvh/lbvh_node.h"

__kernel void meet_node(const uint count,
                        __global const RsRay* restrict rays,
                        __global const fv* restrict node,
                        __global uint* restrict met) {
  const uint i = get_global_id(0);
  if (i >= count) return;
  const Ray raw = load_ray(rays, i);
  const RayData ray = ray_data(raw);
  fv entry;
  met[i] = ray_meets_boxes(&ray, node, raw.t_max, &entry);
}

__kernel void box_blocks(const uint count,
                         const uint padded_blocks,
                         __global const uint* restrict order,
                         __global const RsAabb* restrict boxes,
                         __global float* restrict nodes) {
  const uint block = get_global_id(0);
  if (block >= padded_blocks) return;
  RsBox sum = box_empty();
  for (uint lane = 0; lane < LANES && (size_t)block * LANES + lane < count; ++lane)
    sum = box_union(sum, box_load_clean(boxes, order[(size_t)block * LANES + lane]));
  store_child(nodes, block / LANES, block % LANES, sum);
}
