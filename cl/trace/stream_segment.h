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

#if OPEN > RS_SEGMENT_REACHING
#error "More rows may be open than reach into a segment"
#endif

// Number of the last row of every stream, so high that no window reaches below 0.
#define RS_LAST_NUMBER 0x80000000u

// Segments, of which there may be `room`, counts of them, and of each slot the sums of its segment,
// a number for each ray, and the rows that reach into it.
#define RS_SEGMENT_ARGUMENTS(access)                                                       \
  const uint room, __global access RsStreamSegment *restrict segments,                     \
      __global access uint *restrict counts, __global access float *restrict segment_sums, \
      __global RsReachingRow *restrict reaching

// The segment of group `group` of `room`, RS_NO_SEGMENT for most of them: the `count` that there
// are are spread over all groups, so that each band of a launch has its share.
uint segment_of_group(const uint group, const uint count, const uint room) {
  const uint place = (uint)((ulong)group * count / room);
  return (uint)((ulong)(group + 1) * count / room) > place ? place : RS_NO_SEGMENT;
}

// First pixel of a packet.
int2 packet_corner(const int width, const uint packet) {
  const uint across = (width + RS_GROUP_WIDTH - 1) / RS_GROUP_WIDTH;
  return (int2)((int)(packet % across) * RS_GROUP_WIDTH, (int)(packet / across) * RS_GROUP_HEIGHT);
}

// Of the packet at `corner`, a work-item its own pixel.
RS_GROUP_INLINE void load_group_pixels(Pixels* p,
                                       const BackwardScene scene,
                                       const int2 corner,
                                       const int lane) {
  load_pixels(p, scene, corner.x + lane % RS_GROUP_WIDTH, corner.y + lane / RS_GROUP_WIDTH);
}

// The alpha of the Gaussian of line v in the packet's rays.
float group_alpha(__global const float* v, const PacketMeeting* m) {
  return v[12] * rs_exp(-0.5f * m->numerator / m->direction2);
}

// A row of the pool and what its Gaussian does to a ray.
typedef struct {
  uint2 row;     // reference, window
  float before;  // transmittance in front, 0 in rays that do not blend it
  float share;   // T alpha (colour . gradient)
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
