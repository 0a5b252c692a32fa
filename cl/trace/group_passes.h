// SPDX-License-Identifier: Apache-2.0
// Blending a packet of work-items without limits on hits: every ray looks for the nearest few hits
// behind the last one blended, as often as it takes. group_rows.h does the packets that fit it,
// which is nearly all, in one pass.
#ifndef RS_TRACE_GROUP_PASSES_H
#define RS_TRACE_GROUP_PASSES_H

#include "trace/group.h"
#include "trace/group_rows.h"
#include "trace/hit_stream.h"
#include "trace/packet_state.h"

// Hits found in a pass, in registers.
#define RS_PASS_HITS 4

typedef struct {
  float key[RS_PASS_HITS];  // infinite where there are no more
  float alpha[RS_PASS_HITS];
  uint reference[RS_PASS_HITS];
} PassHits;

bool hit_before(const float key, const uint reference, const float other, const uint of) {
  return key < other || (key == other && reference < of);
}

// The nearest hits behind (key, reference), by one work-item for itself.
RS_GROUP_INLINE void find_behind(const GroupCandidates* c,
                                 const PacketState* p,
                                 __global const RsLine* restrict lines,
                                 __global const uint* restrict references,
                                 __global const float2* restrict limits,
                                 const float last_key,
                                 const int last_reference,
                                 PassHits* hits) {
#pragma unroll
  for (int i = 0; i < RS_PASS_HITS; ++i) {
    hits->key[i] = INFINITY;
    hits->alpha[i] = 0.0f;
    hits->reference[i] = 0;
  }
  for (uint k = c->begin; k < c->end; ++k) {
    if (limits[k].x > hits->key[RS_PASS_HITS - 1]) break;
    __global const float* box = c->boxes + k;
    if (!(box[0] <= c->x1 && box[c->stride] <= c->y1 && box[2 * c->stride] >= c->x0 &&
          box[3 * c->stride] >= c->y0))
      continue;
    const uint reference = references[k];
    const PacketHit found = packet_hit(p, lines, reference, limits[k].y, -1);
    if (!found.hit || !(found.alpha > 0.0f)) continue;
    float key = fabs(found.key);
    if (key < last_key || (key == last_key && (int)reference <= last_reference)) continue;
    float alpha = found.alpha;
    uint id = reference;
#pragma unroll
    for (int i = 0; i < RS_PASS_HITS; ++i) {
      if (!hit_before(key, id, hits->key[i], hits->reference[i])) continue;
      const float other_key = hits->key[i], other_alpha = hits->alpha[i];
      const uint other_id = hits->reference[i];
      hits->key[i] = key;
      hits->alpha[i] = alpha;
      hits->reference[i] = id;
      key = other_key;
      alpha = other_alpha;
      id = other_id;
    }
  }
}

// By moving the others up: an index known at compile time keeps them in registers.
RS_GROUP_INLINE void take_first(PassHits* hits) {
#pragma unroll
  for (int i = 0; i + 1 < RS_PASS_HITS; ++i) {
    hits->key[i] = hits->key[i + 1];
    hits->alpha[i] = hits->alpha[i + 1];
    hits->reference[i] = hits->reference[i + 1];
  }
  hits->key[RS_PASS_HITS - 1] = INFINITY;
}

// Traces the rays that are `alive`. Returns whether the ray lost a hit to max_hits.
RS_GROUP_INLINE bool group_in_passes(__local GroupMemory* memory,
                                     const GroupCandidates* candidates,
                                     const int lane,
                                     bool alive,
                                     __global const RsLine* restrict lines,
                                     __global const uint* restrict references,
                                     __global const float2* restrict limits,
                                     const float min_transmittance,
                                     const int max_hits,
                                     PacketState* p,
                                     HitStream* stream) {
  bool capped = false;
  float last_key = -1.0f;
  int last_reference = -1;
  PassHits hits;
  hits.key[0] = INFINITY;
  bool goes_on = true;
  while (goes_on) {
    if (alive && !(hits.key[0] < INFINITY))
      find_behind(candidates, p, lines, references, limits, last_key, last_reference, &hits);
    alive = alive && hits.key[0] < INFINITY;
    capped = capped || (alive && p->hits >= max_hits);
    alive = alive && !capped;
    bool mine = alive;
#if KEEP_HITS
    // Rays may be at different Gaussians: one of them is blended, by all that are at it.
    const ulong waiting = rs_group_bits(memory->words, lane, alive);
    goes_on = waiting != 0;
    if (alive && lane == (int)rs_lowest_of(waiting)) {
      memory->taken = hits.reference[0];
    }
    rs_group_barrier();
    const uint common = memory->taken;
    rs_group_barrier();
    if (goes_on && lane == 0) memory->taken = stream_push(stream, common, 0);
    rs_group_barrier();
    mine = alive && hits.reference[0] == common;
    if (goes_on) group_stream_set(stream, lane, memory->taken, mine ? p->T : 0.0f);
#else
    goes_on = alive;
#endif
    if (mine) {
      const uint reference = hits.reference[0];
      packet_blend(p, lines[reference >> 1].v, reference & 1, -1, p->T, hits.alpha[0]);
      last_key = hits.key[0];
      last_reference = (int)reference;
      take_first(&hits);
      alive = p->T >= min_transmittance;
    }
  }
#if !KEEP_HITS
  (void)memory;
  (void)lane;
  (void)stream;
#endif
  return capped;
}

#endif
