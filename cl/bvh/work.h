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

// Box read for the grid (24) and for the code (24), two code words and the index written (12), high
// word read to find runs (4).
#define RS_WORK_MORTON_BYTES 64
// Centre 6 and its bounds 6, centre 6 again, cell 9.
#define RS_WORK_MORTON_FLOPS 27
// Passes of the sort by the high word.
#define RS_WORK_MORTON_SORT_PASSES 4

// High word read (4), prefix length written and read (2), leaf index (4), box (24), state of the
// split written and read (8), node written (64).
#define RS_WORK_HIERARCHY_BYTES 106
// Union of two boxes per node 6, box of the leaf's block 6.
#define RS_WORK_HIERARCHY_FLOPS 12

// Leaf index (4), box (24), prefix length (1), state of the split (4) read; bounds of a node (48)
// written.
#define RS_WORK_REFIT_BYTES 81
// As for the hierarchy.
#define RS_WORK_REFIT_FLOPS 12

#endif
