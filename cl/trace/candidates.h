// SPDX-License-Identifier: Apache-2.0
// The way of packets through the candidate list of their tile: the candidates whose outline box
// meets the rays of a packet, in the order of their least depth. A work-item traces BLOCK x BLOCK
// packets one after the other; whoever reads on in the list does so for the packets after it too,
// so that a long list is read once per work-item and not once per packet.
#ifndef RS_TRACE_CANDIDATES_H
#define RS_TRACE_CANDIDATES_H

#include "trace/packet.h"
#include "trace/work_tally.h"

// Packets a side of a work-item's block.
#ifndef BLOCK
#define BLOCK 1
#endif
#define RS_BLOCK_PACKETS (BLOCK * BLOCK)

// Candidates found for a packet and not yet taken; beyond, it reads the list itself.
#if BLOCK > 1
#define RS_QUEUE 256
#else
#define RS_QUEUE PACKET
#endif

typedef struct {
  __global const float* boxes;  // planes of `stride`: x0, y0, x1, y1
  size_t stride;
  uint begin, end;  // of the list
  float x0[RS_BLOCK_PACKETS], y0[RS_BLOCK_PACKETS];
  float x1[RS_BLOCK_PACKETS], y1[RS_BLOCK_PACKETS];  // outermost rays of every packet
  uint read[RS_BLOCK_PACKETS];                       // up to here the list is in the queue
  uint count[RS_BLOCK_PACKETS];                      // of the queue
  uint queue[RS_BLOCK_PACKETS][RS_QUEUE];
#if COUNT_WORK
  uint tally[RS_TALLIES];
#endif
} BlockCandidates;

typedef struct {
  BlockCandidates* block;
  uint packet;
  uint taken;  // of the queue
  uint end;    // what candidates_next() yields behind the last
} Candidates;

void block_candidates_init(BlockCandidates* b,
                           __global const float* boxes,
                           const size_t stride,
                           const uint begin,
                           const uint end) {
  b->boxes = boxes;
  b->stride = stride;
  b->begin = begin;
  b->end = end;
  for (uint q = 0; q < RS_BLOCK_PACKETS; ++q) {
    b->read[q] = begin;
    b->count[q] = 0;
  }
}

// Tests the next PACKET boxes for the packet and those behind it that have read as far. Loads past
// the end of the list stay inside the planes' padding.
void block_candidates_read(BlockCandidates* b, const uint packet) {
  const uint base = b->read[packet];
  __global const float* boxes = b->boxes + base;
  const fv x0 = rs_load(boxes);
  const fv y0 = rs_load(boxes + b->stride);
  const fv x1 = rs_load(boxes + 2 * b->stride);
  const fv y1 = rs_load(boxes + 3 * b->stride);
  const uint inside =
      b->end - base < PACKET ? (1u << (b->end - base)) - 1u : (2u << (PACKET - 1)) - 1u;
  for (uint q = packet; q < RS_BLOCK_PACKETS; ++q) {
    if (b->read[q] != base || b->count[q] > RS_QUEUE - PACKET) continue;
    const iv meets = RS_MASK(x0 <= b->x1[q]) & RS_MASK(y0 <= b->y1[q]) & RS_MASK(x1 >= b->x0[q]) &
                     RS_MASK(y1 >= b->y0[q]);
    b->count[q] += rs_append_lanes(b->queue[q] + b->count[q], base, rs_lane_bits(meets) & inside);
    b->read[q] = base + PACKET;
    RS_TALLY(b, RS_TALLY_BOXES, 1);
  }
}

// Goes back to the first candidate.
void candidates_restart(Candidates* c) {
  c->block->read[c->packet] = c->block->begin;
  c->block->count[c->packet] = c->taken = 0;
}

// Index of the next candidate, or `end`.
uint candidates_next(Candidates* c) {
  BlockCandidates* b = c->block;
  const uint packet = c->packet;
  if (c->taken == b->count[packet]) {
    b->count[packet] = c->taken = 0;
    while (b->count[packet] == 0) {
      if (b->read[packet] >= b->end) return c->end;
      block_candidates_read(b, packet);
    }
  }
  return b->queue[packet][c->taken++];
}

#endif
