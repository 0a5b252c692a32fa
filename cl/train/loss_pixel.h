// SPDX-License-Identifier: Apache-2.0
// What the loss takes from a pixel by itself: the sums of the pixel term. With the mask m the
// images compared are y and x' = y + m (x - y).
#ifndef RS_TRAIN_LOSS_PIXEL_H
#define RS_TRAIN_LOSS_PIXEL_H

#include "parallel/vector_lanes.h"

#ifndef PIXEL_L2
#define PIXEL_L2 0
#endif

typedef struct {
  fv pixel, square, weight;  // sums of m rho(x - y), m (clamp(x) - y)^2, m
} LossSums;

// Adds a pixel of one channel; returns m (x - y).
fv rs_add_pixel(fv x, fv y, fv mask, LossSums* sums) {
  const fv difference = x - y;
  const fv masked = mask * difference;
#if PIXEL_L2
  sums->pixel += masked * difference;
#else
  sums->pixel += fabs(masked);
#endif
  fv shown = rs_pick(x > 1.0f, 1.0f, x);
  shown = rs_pick(shown < 0.0f, 0.0f, shown);
  sums->square += mask * (shown - y) * (shown - y);
  sums->weight += mask;
  return masked;
}

// scale m rho'(x - y), from v = m (x - y).
fv rs_pixel_gradient(fv v, fv mask, float scale) {
#if PIXEL_L2
  return 2.0f * scale * v;
#else
  return mask * rs_pick(v > 0.0f, scale, rs_pick(v < 0.0f, -scale, v));
#endif
}

#endif
