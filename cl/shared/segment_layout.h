// SPDX-License-Identifier: Apache-2.0
// Parts of hit streams that run backward one beside the other, shared by kernels and host, under
// the rules of layout.h.
#ifndef RS_SHARED_SEGMENT_LAYOUT_H
#define RS_SHARED_SEGMENT_LAYOUT_H

#include "shared/compat.h"

// Chunks of a segment, but of the nearest one of a stream, which has what is left.
#define RS_SEGMENT_CHUNKS 16
// Rows that may reach into a segment: as many as may be open at once (OPEN in cl/trace/group.h).
#define RS_SEGMENT_REACHING 64
// What stands for no segment, and for no slot.
#define RS_NO_SEGMENT 0xffffffffu

// Rows are numbered through the whole stream, the last one highest.
typedef struct {
  rs_uint packet;
  rs_uint chunk;   // its last one
  rs_uint used;    // rows used in that, as the end of a stream says it
  rs_uint rows;    // all of its own
  rs_uint number;  // of its last row
  rs_uint behind;  // the segment of the stream that follows
  rs_uint front;   // and the one that it follows
  rs_uint slot;    // where its sums lie; none for a stream of one segment
} RsStreamSegment;
RS_STATIC_ASSERT_SIZE(RsStreamSegment, 32);

// A row of a segment that rows of the one in front may change places with.
typedef struct {
  rs_uint row;     // of the pool
  rs_uint number;  // in the stream
} RsReachingRow;
RS_STATIC_ASSERT_SIZE(RsReachingRow, 8);

// Words that count segments, slots, and from RS_SEGMENT_COUNTS on what reaches into each slot's.
#define RS_SEGMENT_COUNT 0
#define RS_SEGMENT_SLOTS 1
#define RS_SEGMENT_COUNTS 2

#endif
