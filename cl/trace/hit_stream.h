// SPDX-License-Identifier: Apache-2.0
// The hits of a packet in blending order, packed: a stream of (Gaussian, lane mask) entries such
// that every lane meets its own hits in its own exact order. Chunks of a shared pool are linked
// backwards, because the backward pass reads last to first. Memory follows the number of hits,
// never a worst case per pixel.
#ifndef RS_TRACE_HIT_STREAM_H
#define RS_TRACE_HIT_STREAM_H

// Entries per chunk; entry 0 links to the previous chunk.
#ifndef CHUNK
#define CHUNK 32
#endif
#define RS_NO_CHUNK 0xffffffffu

typedef struct {
  uint chunk;  // last chunk, RS_NO_CHUNK when empty
  uint used;   // entries used in it, the link included
} StreamEnd;

void stream_push(__private StreamEnd* end,
                 __global uint2* pool,
                 const uint capacity,
                 volatile __global uint* cursor,
                 uint reference,
                 uint lanes) {
  if (end->chunk == RS_NO_CHUNK || end->used == CHUNK) {
    const uint next = atomic_inc(cursor);
    if (next < capacity) pool[(size_t)next * CHUNK] = (uint2)(end->chunk, 0);
    end->chunk = next;
    end->used = 1;
  }
  // Past the capacity only the demand is counted; the host retries with less work or more memory.
  if (end->chunk < capacity)
    pool[(size_t)end->chunk * CHUNK + end->used] = (uint2)(reference, lanes);
  ++end->used;
}

#endif
