// SPDX-License-Identifier: Apache-2.0
// Sizes of the records of the tree that rays walk, in vectors of one float for every lane; what is
// in them is told where kernels read them (bvh/lbvh_node.h, trace/ray_block.h,
// light/triangle_block.h).
#ifndef RS_SHARED_TREE_LAYOUT_H
#define RS_SHARED_TREE_LAYOUT_H

#define RS_NODE_VECTORS 6
// Gaussians; `adaptive` is 1 where each has a radius of its own, else 0.
#define RS_GAUSSIAN_VECTORS(adaptive) (15 + (adaptive))
#define RS_GAUSSIAN_MEAN 6
#define RS_GAUSSIAN_INDEX(adaptive) (10 + (adaptive))
// Those that rays with cones meet: axes and scales in place of matrices.
#define RS_CONE_VECTORS 24
#define RS_CONE_MEAN 12
#define RS_CONE_INDEX 17
#define RS_TRIANGLE_VECTORS 10

#endif
