// SPDX-License-Identifier: Apache-2.0
// What building the tree must at least do, counted by hand per box (of N): bytes that have to move
// when nothing is read twice, and arithmetic operations (a fused multiply-add counts two; minimum,
// maximum, division, root, exponential count one). Read by the host's benchmarks.
#ifndef RS_BVH_WORK_H
#define RS_BVH_WORK_H

// Mean 12, quaternion 16, scale 12, opacity 4 read; box 24 written.
#define RS_WORK_BOUNDS_BYTES 68
// Quaternion to unit length 20, rotation 36, activated scales 6, scaled axes 12, three squared
// lengths 15, half-widths 12, corners 6.
#define RS_WORK_BOUNDS_FLOPS 107

// Order: box read for the grid, for the code and for its group (72), two code words and the index
// written (12), high word read to find runs (4), index read and written for its group (8).
#define RS_WORK_ORDER_BYTES 96
// Centre 6 and its bounds 6, centre 6 again, cell 9; in its group centre and keys 12, and the
// unions of a sweep along three axes on four levels 72.
#define RS_WORK_ORDER_FLOPS 111
// Passes of the sort by the high word.
#define RS_WORK_ORDER_SORT_PASSES 4

// Blocks and nodes, per Gaussian: index (4), box (24), parameters (44), colour (12) read; its lanes
// of the block written (60). The boxes of nodes are few.
#define RS_WORK_NODES_BYTES 144
// Rotation 36, unit quaternion 12, scales and opacity 15, whitening triangle 75, union of boxes 6,
// colour 6.
#define RS_WORK_NODES_FLOPS 150

#endif
