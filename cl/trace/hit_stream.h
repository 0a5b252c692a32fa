// SPDX-License-Identifier: Apache-2.0
// The hits of a packet, packed for the backward pass: rows of (Gaussian, window) and, beside them,
// the transmittance in front of the Gaussian per lane, 0 in lanes that do not blend it. Two rows of
// a stream may be met in different orders by different lanes, but only if the later one's window
// reaches the earlier: rows r - window .. r - 1 were not settled when row r was found. Chunks of a
// shared pool are linked backwards, because the backward pass reads last to first. Memory follows
// the number of hits, never a worst case per pixel.
#ifndef RS_TRACE_HIT_STREAM_H
#define RS_TRACE_HIT_STREAM_H

#include "trace/packet.h"
#include "trace/view_sizes.h"
#include "trace/work_tally.h"

// Rows per chunk; row 0 links to the previous chunk.
#ifndef CHUNK
#define CHUNK 16
#endif
// Largest window a stream may hold; the backward pass keeps as many rows open.
#ifndef WINDOW
#if PACKET == 1
// One ray meets its Gaussians in one order: three rows were the most that were open in any scene
// measured. A packet that needs more goes the way without a window.
#define WINDOW 4
#else
#define WINDOW 128
#endif
#endif
// Demand is not counted beyond this: the cursor must not come round to chunks that are taken.
#define RS_MOST_CHUNKS 0x80000000u
#define RS_NO_ROW 0xffffffffu
// Beside the rows used where a group's stream ends: it is for the launch with CROWDED.
#define RS_STREAM_CROWDED 0x80000000u

typedef struct {
  __global uint2* pool;            // (Gaussian reference, window)
  __global float* transmittance;   // PACKET floats per row of the pool
  uint capacity;                   // chunks
  volatile __global uint* cursor;  // chunks taken, of which those past the capacity do not exist
  uint chunk;                      // last chunk, RS_NO_CHUNK when empty
  uint used;                       // rows used in it, the link included
#if COUNT_WORK
  uint tally[RS_TALLIES];
#endif
} HitStream;

// Returns the row of the pool, or RS_NO_ROW past the capacity: then only the demand is counted, and
// the host retries with less work or more memory.
uint stream_push(HitStream* stream, uint reference, uint window) {
  if (stream->chunk == RS_NO_CHUNK || stream->used == CHUNK) {
    uint next = atomic_inc(stream->cursor);
    if (next >= RS_MOST_CHUNKS) {
      next = RS_MOST_CHUNKS;
      atomic_add(stream->cursor, 0xffffffffu);  // back: a least value is a swap on some devices
    }
    if (next < stream->capacity) stream->pool[(size_t)next * CHUNK] = (uint2)(stream->chunk, 0);
    stream->chunk = next;
    stream->used = 1;
  }
  const uint row =
      stream->chunk < stream->capacity ? stream->chunk * CHUNK + stream->used : RS_NO_ROW;
  if (row != RS_NO_ROW) stream->pool[row] = (uint2)(reference, window);
  ++stream->used;
  RS_TALLY(stream, RS_TALLY_WINDOWS, window);
  return row;
}

void stream_set(HitStream* stream, uint row, fv transmittance) {
  if (row != RS_NO_ROW) rs_store(transmittance, stream->transmittance + (size_t)row * PACKET);
}

// Takes everything back but the chunks.
void stream_restart(HitStream* stream) {
  stream->chunk = RS_NO_CHUNK;
  stream->used = CHUNK;
}

#endif
