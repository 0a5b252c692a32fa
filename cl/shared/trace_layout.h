// SPDX-License-Identifier: Apache-2.0
// What launches of the tracing kernels are told, shared by kernels and host, under the rules of
// layout.h.
#ifndef RS_SHARED_TRACE_LAYOUT_H
#define RS_SHARED_TRACE_LAYOUT_H

#include "shared/layout.h"

// Packets of a view, forward.
typedef struct {
  rs_int window[4];  // of tiles: first column, first row, columns, rows
  rs_float background[3];
  rs_float min_transmittance;
  rs_int max_hits;
  rs_uint pool_capacity;  // chunks
  rs_int padding[2];
} RsForward;
RS_STATIC_ASSERT_SIZE(RsForward, 48);

// The same backward.
typedef struct {
  rs_uint gaussians;
  rs_uint copies;  // of the gradient lines
  rs_uint tiles_x, tile_row, tile_rows;
  rs_float background[3];
  rs_float screen_x, screen_y;  // from tangent to normalised device coordinates
  rs_float limit;               // of LineSums
  rs_int padding;
} RsBackward;
RS_STATIC_ASSERT_SIZE(RsBackward, 48);

// What finalize_gradients and finalize_group are told, which lead from lines to parameters.
typedef struct {
  rs_uint gaussians;
  rs_uint copies;
  rs_float screen_x, screen_y;
} RsFinalize;
RS_STATIC_ASSERT_SIZE(RsFinalize, 16);

// What all rays of a launch share.
typedef struct {
  rs_float near[4];  // axis and depth from the origin that means have to reach, for NEAR_LIMIT
  rs_float background[3];
  rs_float quantile;
  rs_float min_transmittance;
  rs_int max_hits;
  rs_int sh_coefficients;
  rs_int active_degree;
  rs_int color_from_origin;  // 0: colours along the rays, 1: from their origins, 2: a flag a ray
  rs_int has_cones;          // whether every ray has one: of builds with CONES
  rs_int padding[2];
} RsRayWalk;
RS_STATIC_ASSERT_SIZE(RsRayWalk, 64);

// How the gradients of rays are summed.
typedef struct {
  rs_float screen[16];  // 0..8: 3 x 3 matrix, row-major, from the gradient of a mean to its share
                        // on the screen for a mean at distance 1; 9..15: of ray_gradients.cl
  rs_uint gaussians;
  rs_float limit;  // of LineSums
  rs_int padding[2];
} RsRaySums;
RS_STATIC_ASSERT_SIZE(RsRaySums, 80);

#endif
