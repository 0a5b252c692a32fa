// SPDX-License-Identifier: Apache-2.0
// What tracing must at least do, counted by hand: bytes that have to move when nothing is read
// twice from memory, and arithmetic operations (a fused multiply-add counts two; minimum, maximum,
// division, root, exponential count one). Work on candidates that no ray meets counts as nothing,
// so that poor culling shows as a low share of the device's limits. Read by the host's benchmarks.
#ifndef RS_TRACE_WORK_H
#define RS_TRACE_WORK_H

// prepare_view, per Gaussian: mean 12, quaternion 16, scale 12, opacity 4 read; line 64 and bounds
// 32 written. SH coefficients come on top, 12 bytes each.
#define RS_WORK_PREPARE_BYTES 140
// Rotation 36, axes and mean in camera axes 60, unit quaternion 12, scales and opacity 15, culling
// 41, line 100, outline 94, direction 10.
#define RS_WORK_PREPARE_FLOPS 368
// One SH coefficient: three fused multiply-adds.
#define RS_WORK_SH_FLOPS 6
#define RS_WORK_SH_BYTES 12

// Tile lists, per Gaussian: bounds 32 read twice, count written, scanned and read (16), line 64.
#define RS_WORK_LIST_GAUSSIAN_BYTES 144
// Twice the range of tiles.
#define RS_WORK_LIST_GAUSSIAN_FLOPS 48
// Per (tile, Gaussian) candidate: pair written (8); gathered in order: pair 8 and bounds 32 read,
// box 16 and limits 8 written (64). The sort comes on top, RS_WORK_SORT_PASS_BYTES per pass.
#define RS_WORK_LIST_BYTES 72
// Corner of the tile, depth of the plane and its key.
#define RS_WORK_LIST_FLOPS 24

// trace_forward, per candidate: box 16, limits 8, index 4, line 64.
#define RS_WORK_FORWARD_CANDIDATE_BYTES 92
// Per pixel: R, G, B, A.
#define RS_WORK_FORWARD_PIXEL_BYTES 16
// Per hit: offsets 2, numerator 7, denominator 7, depth 1, test 1 (18); squared distance and peak
// 3; response 19; blending 9.
#define RS_WORK_FORWARD_FLOPS 49
// Near root in entry order.
#define RS_WORK_ENTRY_FLOPS 10

// trace_backward, per Gaussian: line 64 read, its gradient 64 read and written.
#define RS_WORK_BACKWARD_GAUSSIAN_BYTES 192
// Per pixel: gradient of R, G, B, A and two transmittances. Streams come on top.
#define RS_WORK_BACKWARD_PIXEL_BYTES 24
// Per hit: geometry 19, response 19, transmittance 2, colour and suffix 12; the line's gradient:
// geometry 19, chain 43, sum over rays 14.
#define RS_WORK_BACKWARD_FLOPS 128

// finalize_gradients, per Gaussian: line gradient 64, shape and colours of the line 40, bounds 32,
// parameters 44 read; gradients 44 and statistics 16 written. SH coefficients come on top, 12 read
// and 12 written each.
#define RS_WORK_FINALIZE_BYTES 240
// Parameters as in prepare_view 123, line to camera axes 132, rotation and quaternion 80, scales
// 15, opacity 3, screen statistics 10, direction 20.
#define RS_WORK_FINALIZE_FLOPS 383
// One SH coefficient: its gradient 3, the colour along it 6, direction 6.
#define RS_WORK_FINALIZE_SH_FLOPS 15

// Arbitrary rays, per ray: ray 32 read, result 32 written.
#define RS_WORK_RAY_BYTES 64
// Per hit: record 64, a node 64, leaf index 4.
#define RS_WORK_RAY_HIT_BYTES 132
// Per hit: origin and direction whitened 33, squared lengths and peak 11, residual 11, near root 8,
// response 3, blending 11.
#define RS_WORK_RAY_HIT_FLOPS 77

#endif
