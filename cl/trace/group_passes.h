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

// Hits found in a pass, at most OPEN_LOCAL.
#define RS_PASS_HITS 4

// Where they are kept: in the columns of the open rows, of which there are none now. The keys are
// infinite where there are no more hits.
typedef struct {
  RowColumns key, alpha, reference;  // references as the bits of floats
  int lane;
} PassHits;

bool pass_before(const PassHits* hits, const int i, const float key, const uint reference) {
  const float own = hits->key[i][hits->lane];
  return own < key || (own == key && as_uint(hits->reference[i][hits->lane]) < reference);
}

void pass_set(
    const PassHits* hits, const int i, const float key, const float alpha, const float reference) {
  hits->key[i][hits->lane] = key;
  hits->alpha[i][hits->lane] = alpha;
  hits->reference[i][hits->lane] = reference;
}

// The nearest hits behind (key, reference), by one work-item for itself.
RS_GROUP_INLINE void find_behind(const GroupCandidates* c,
                                 const PacketState* p,
                                 const PacketScene scene,
                                 const float last_key,
                                 const int last_reference,
                                 const PassHits* hits) {
  const int lane = hits->lane;
  for (int i = 0; i < RS_PASS_HITS; ++i) pass_set(hits, i, INFINITY, 0.0f, 0.0f);
  for (uint k = c->begin; k < c->end; ++k) {
    if (scene.limits[k].x > hits->key[RS_PASS_HITS - 1][lane]) break;
    __global const float* box = c->boxes + k;
    if (!(box[0] <= c->x1 && box[c->stride] <= c->y1 && box[2 * c->stride] >= c->x0 &&
          box[3 * c->stride] >= c->y0))
      continue;
    const uint reference = scene.references[k];
    const PacketHit found = packet_hit(p, scene, reference, scene.limits[k].y, -1);
    if (!found.hit || !(found.alpha > 0.0f)) continue;
    const float key = fabs(found.key);
    if (key < last_key || (key == last_key && (int)reference <= last_reference)) continue;
    // What is farther moves up; the farthest falls out.
    int i = RS_PASS_HITS;
    for (; i > 0 && !pass_before(hits, i - 1, key, reference); --i) {
      if (i == RS_PASS_HITS) continue;
      pass_set(hits, i, hits->key[i - 1][lane], hits->alpha[i - 1][lane],
               hits->reference[i - 1][lane]);
    }
    if (i < RS_PASS_HITS) pass_set(hits, i, key, found.alpha, as_float(reference));
  }
}

// Traces the rays that are `alive`. Returns whether the ray lost a hit to max_hits.
RS_GROUP_INLINE bool group_in_passes(__local ForwardMemory* memory,
                                     const GroupCandidates* candidates,
                                     const int lane,
                                     bool alive,
                                     const PacketScene scene,
                                     PacketState* p,
                                     HitStream* stream) {
  bool capped = false;
  float last_key = -1.0f;
  int last_reference = -1;
  const PassHits hits = {memory->open.key, memory->open.alpha, memory->open.before, lane};
  int next = RS_PASS_HITS;  // of those found
  bool goes_on = true;
  while (goes_on) {
    if (alive && (next == RS_PASS_HITS || !(hits.key[next][lane] < INFINITY))) {
      find_behind(candidates, p, scene, last_key, last_reference, &hits);
      next = 0;
    }
    alive = alive && hits.key[next][lane] < INFINITY;
    capped = capped || (alive && p->hits >= scene.max_hits);
    alive = alive && !capped;
    bool mine = alive;
#if KEEP_HITS
    // Rays may be at different Gaussians: one of them is blended, by all that are at it.
    const ulong waiting = rs_group_bits(memory->words, lane, alive);
    goes_on = waiting != 0;
    if (alive && lane == (int)rs_lowest_of(waiting)) {
      memory->taken = as_uint(hits.reference[next][lane]);
    }
    rs_group_barrier();
    const uint common = memory->taken;
    rs_group_barrier();
    if (goes_on && lane == 0) memory->taken = group_push(memory, common, 0, stream);
    rs_group_barrier();
    mine = alive && as_uint(hits.reference[next][lane]) == common;
    if (goes_on) group_stream_set(stream, lane, memory->taken, mine ? p->T : 0.0f);
#else
    goes_on = alive;
#endif
    if (mine) {
      const uint reference = as_uint(hits.reference[next][lane]);
      packet_blend(p, scene.lines[reference >> 1].v, reference & 1, -1, p->T,
                   hits.alpha[next][lane]);
      last_key = hits.key[next][lane];
      last_reference = (int)reference;
      ++next;
      alive = p->T >= scene.min_transmittance;
    }
  }
#if !KEEP_HITS
  (void)stream;
#endif
  return capped;
}

#endif
