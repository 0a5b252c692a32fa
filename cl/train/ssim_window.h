// SPDX-License-Identifier: Apache-2.0
// The 11-tap Gaussian window (sigma 1.5, sums to 1) of Wang et al. 2004 and the padded planes it
// slides over: PAD zero columns left and right, RADIUS zero rows above and below, so that no loop
// checks a border.
#ifndef RS_TRAIN_SSIM_WINDOW_H
#define RS_TRAIN_SSIM_WINDOW_H

#include "parallel/vector_lanes.h"

#ifndef TILE
#define TILE 32
#endif
#ifndef ROWS
#define ROWS 4
#endif

#define RADIUS 5
#define PAD 16
// Columns left and right of a tile that its windows reach, in whole vectors.
#define HALO ((RADIUS + LANES - 1) / LANES * LANES)
#define TILE_SPAN (TILE + 2 * HALO)

#define W0 0.2660117249f
#define W1 0.2130055377f
#define W2 0.1093606895f
#define W3 0.03600077213f
#define W4 0.007598758135f
#define W5 0.001028380084f

// Element (0, row) of a padded plane.
#define RS_PADDED(row, stride) (((row) + RADIUS) * (stride) + PAD)

// One output of the window along a row of private memory, from its 11 neighbours.
fv rs_window_row(const float* p) {
  return W0 * rs_load_private(p) + W1 * (rs_load_private(p - 1) + rs_load_private(p + 1)) +
         W2 * (rs_load_private(p - 2) + rs_load_private(p + 2)) +
         W3 * (rs_load_private(p - 3) + rs_load_private(p + 3)) +
         W4 * (rs_load_private(p - 4) + rs_load_private(p + 4)) +
         W5 * (rs_load_private(p - 5) + rs_load_private(p + 5));
}

// The same along a column of a plane.
fv rs_window_column(const __global float* p, int stride) {
  return W0 * rs_load(p) + W1 * (rs_load(p - stride) + rs_load(p + stride)) +
         W2 * (rs_load(p - 2 * stride) + rs_load(p + 2 * stride)) +
         W3 * (rs_load(p - 3 * stride) + rs_load(p + 3 * stride)) +
         W4 * (rs_load(p - 4 * stride) + rs_load(p + 4 * stride)) +
         W5 * (rs_load(p - 5 * stride) + rs_load(p + 5 * stride));
}

#endif
