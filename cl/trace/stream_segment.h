// SPDX-License-Identifier: Apache-2.0
// Segments of hit streams. A group runs a stream backward row by row, and a view waits for the
// longest; so long streams are cut, and their segments run one beside the other. What a segment has
// to know of the rows behind it is, per ray, the sum of T alpha (colour . gradient) over them, and
// which of them its own rows may change places with: those that were open when its last row was
// settled, fewer than a launch keeps open. These the group opens first, then it goes on as if it
// had come from behind; the sum of all others stands for one hit behind everything. Rows that are
// still open where the segment ends hear of those in front of it until none may lie behind them.
#ifndef RS_TRACE_STREAM_SEGMENT_H
#define RS_TRACE_STREAM_SEGMENT_H

#include "shared/segment_layout.h"
#include "trace/group.h"
#include "trace/hit_stream.h"
#include "trace/line_gradient.h"

// The last row of every stream: a number that no window reaches below.
#define RS_LAST_NUMBER 0x80000000u

#define RS_SEGMENT_ARGUMENTS(access)                                                         \
  __global access RsStreamSegment *restrict segments, __global access uint *restrict counts, \
      __global access float *restrict segment_sums, __global RsReachingRow *restrict reaching

// First pixel of a packet.
int2 packet_corner(const int width, const uint packet) {
  const uint across = (width + RS_GROUP_WIDTH - 1) / RS_GROUP_WIDTH;
  return (int2)((int)(packet % across) * RS_GROUP_WIDTH, (int)(packet / across) * RS_GROUP_HEIGHT);
}

// The alpha of the Gaussian of line v in the packet's rays.
float group_alpha(__global const float* v, const PacketMeeting* m) {
  return v[12] * rs_exp(-0.5f * m->numerator / m->direction2);
}

// A row of the pool: what its Gaussian blends into the ray, and with which transmittance in front.
typedef struct {
  uint2 row;  // reference, window
  float before;
  float share;  // T alpha (colour . gradient)
} StreamHit;

RS_GROUP_INLINE StreamHit stream_hit(const BackwardScene scene,
                                     const Pixels* p,
                                     const size_t row,
                                     const int lane) {
  StreamHit hit;
  hit.row = scene.pool[row];
  hit.before = scene.pool_transmittance[row * GROUP + lane];
  __global const float* v = scene.lines[hit.row.x >> 1].v;
  const PacketMeeting m = rs_meet(v, hit.row.x & 1, 0.0f, p->X, p->Y);
  hit.share = hit.before * group_alpha(v, &m) * rs_projected(p, v, &m);
  return hit;
}

#endif
