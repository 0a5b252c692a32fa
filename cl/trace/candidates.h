// SPDX-License-Identifier: Apache-2.0
// A packet's way through the candidate list of its tile: the candidates whose outline box meets the
// block of the packet's rays, in the order of their least depth.
#ifndef RS_TRACE_CANDIDATES_H
#define RS_TRACE_CANDIDATES_H

#include "trace/packet.h"

typedef struct {
  __global const float* boxes;  // planes of `stride`: x0, y0, x1, y1
  size_t stride;
  float x0, y0, x1, y1;  // block of the packet's rays
  uint begin, end;       // of the list
  uint block;            // first candidate not looked at
  uint base, bits;       // candidates found and not yet taken
} Candidates;

void candidates_restart(Candidates* c) {
  c->block = c->base = c->begin;
  c->bits = 0;
}

// Index of the next candidate, or `end`. Tests PACKET boxes at once; loads past the end of the list
// stay inside the planes' padding.
uint candidates_next(Candidates* c) {
  while (c->bits == 0 && c->block < c->end) {
    c->base = c->block;
    __global const float* boxes = c->boxes + c->base;
    const iv meets = RS_MASK(rs_load_float(boxes) <= c->x1) &
                     RS_MASK(rs_load_float(boxes + c->stride) <= c->y1) &
                     RS_MASK(rs_load_float(boxes + 2 * c->stride) >= c->x0) &
                     RS_MASK(rs_load_float(boxes + 3 * c->stride) >= c->y0);
    c->bits = rs_lane_bits(meets);
    if (c->end - c->base < PACKET) c->bits &= (1u << (c->end - c->base)) - 1u;
    c->block += PACKET;
  }
  if (c->bits == 0) return c->end;
  const uint k = c->base + rs_lowest_bit(c->bits);
  c->bits &= c->bits - 1;
  return k;
}

#endif
