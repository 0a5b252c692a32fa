// SPDX-License-Identifier: Apache-2.0
// Makes the nodes of the implicit tree of lbvh_node.h over boxes in the order of curve.cl and
// order.h: merge_nodes writes the boxes of one level. What lies in the blocks is written by others,
// who also store the blocks' boxes in the nodes of level 1. A refit repeats that and merge_nodes.
// O(n).
#include "bvh/lbvh_node.h"

// Boxes of the `count` nodes from `source` into the lanes of the level above, which begins at
// `target`. Launch: at least `count` rounded up to a multiple of LANES.
__kernel void merge_nodes(__global float* nodes,
                          const uint source,
                          const uint count,
                          const uint target) {
  const uint i = get_global_id(0);
  if (i >= (count + LANES - 1) / LANES * LANES) return;
  RsBox sum = box_empty();
  if (i < count) {
    for (uint k = 0; k < LANES; ++k) sum = box_union(sum, load_child(nodes, source + i, k));
  }
  store_child(nodes, target + i / LANES, i % LANES, sum);
}
