// SPDX-License-Identifier: Apache-2.0
// Blending a packet of work-items without limits on hits: every ray keeps a short list of the hits
// that it has yet to blend, nearest first. Where a list is full its farthest hit falls out, and
// another pass through the candidates begins behind the last one blended, as often as it takes.
// All work-items test one candidate at a time, as in group_rows.h, which does the packets that fit
// it, nearly all, in one pass.
#ifndef RS_TRACE_GROUP_PASSES_H
#define RS_TRACE_GROUP_PASSES_H

#include "trace/group.h"
#include "trace/group_rows.h"
#include "trace/hit_stream.h"
#include "trace/packet_state.h"

// Hits of a list: as many as there are open rows in local memory, whose columns they take.
#define RS_LIST_HITS OPEN_LOCAL

// A place in the order of hits.
typedef struct {
  float key;
  int reference;
} Place;

bool place_before(const Place a, const Place b) {
  return a.key < b.key || (a.key == b.key && a.reference < b.reference);
}

// The hits of one ray that wait, in the order of the ray: a ring in its column.
typedef struct {
  RowColumns key, alpha, candidate;  // candidates as the bits of floats
  int lane;
  uint first, count;
  Place last;   // that was blended
  Place lost;   // the nearest that fell out in this pass: what lies behind it waits for another
  uint resume;  // first candidate of those
  int alive;
  bool capped;  // lost a hit to max_hits
} HitList;

// For another pass.
void list_clear(HitList* list) {
  list->first = list->count = 0;
  list->lost.key = INFINITY;
  list->lost.reference = 0x7fffffff;
  list->resume = RS_NO_ROW;
}

uint list_slot(const HitList* list, const uint i) { return (list->first + i) % RS_LIST_HITS; }

uint list_candidate(const HitList* list, const uint i) {
  return as_uint(list->candidate[list_slot(list, i)][list->lane]);
}

Place list_place(const HitList* list, const PacketScene scene, const uint i) {
  const Place place = {list->key[list_slot(list, i)][list->lane],
                       (int)scene.references[list_candidate(list, i)]};
  return place;
}

// Whether `place` is before the i-th hit of the list.
bool list_before(const HitList* list, const PacketScene scene, const Place place, const uint i) {
  const float key = list->key[list_slot(list, i)][list->lane];
  return place.key < key || (place.key == key && place_before(place, list_place(list, scene, i)));
}

void list_lose(HitList* list, const Place place, const uint candidate) {
  if (place_before(place, list->lost)) list->lost = place;
  list->resume = min(list->resume, candidate);
}

void list_insert(
    HitList* list, const PacketScene scene, const Place place, const uint k, const float alpha) {
  const uint end = list->count - 1;
  const bool full = list->count == RS_LIST_HITS;
  if (!place_before(place, list->lost) || (full && !list_before(list, scene, place, end))) {
    list_lose(list, place, k);
    return;
  }
  if (full) {
    list_lose(list, list_place(list, scene, end), list_candidate(list, end));
    --list->count;
  }
  uint i = list->count++;
  for (; i > 0 && list_before(list, scene, place, i - 1); --i) {
    const uint to = list_slot(list, i), from = list_slot(list, i - 1);
    list->key[to][list->lane] = list->key[from][list->lane];
    list->alpha[to][list->lane] = list->alpha[from][list->lane];
    list->candidate[to][list->lane] = list->candidate[from][list->lane];
  }
  const uint slot = list_slot(list, i);
  list->key[slot][list->lane] = place.key;
  list->alpha[slot][list->lane] = alpha;
  list->candidate[slot][list->lane] = as_float(k);
}

// Tests the next `batch` candidates of the queue: a work-item its own ray, which takes what lies
// behind the last hit that it has blended.
RS_GROUP_INLINE void group_list_batch(__local ForwardMemory* memory,
                                      const GroupCandidates* candidates,
                                      const int batch,
                                      const PacketScene scene,
                                      const PacketState* p,
                                      HitList* list) {
  group_stage_batch(memory, candidates, list->lane, batch, scene);
  rs_group_barrier();
  for (int j = 0; j < batch; ++j) {
    const uint k = memory->queue[(candidates->taken + j) % RS_GROUP_QUEUE];
    const uint reference = memory->batch_reference[j];
    const PacketHit hit = packet_hit(p, scene, reference, memory->batch_quantile[j], list->alive);
    const Place place = {fabs(hit.key), (int)reference};
    if (hit.hit && hit.alpha > 0.0f && place_before(list->last, place))
      list_insert(list, scene, place, k, hit.alpha);
  }
#if SUBGROUP
  rs_group_barrier();  // groups meet one before the queue is written again
#endif
}

// Whether the nearest hit of the list can be blended: nothing that comes later in the candidates is
// nearer than `bound`, where an equal one may still come before it. Ends the ray where it has no
// room for the hit.
bool list_ready(HitList* list, const PacketScene scene, const PacketState* p, const float bound) {
  const bool ready = list->alive && list->count > 0 &&
                     (list->key[list->first][list->lane] < bound || !(bound < INFINITY));
  list->capped = list->capped || (ready && p->hits >= scene.max_hits);
  list->alive &= RS_MASK(!list->capped);
  return ready && list->alive;
}

// Blends the nearest hit of the list and takes it off.
void list_blend(HitList* list, const PacketScene scene, PacketState* p) {
  const Place place = list_place(list, scene, 0);
  packet_blend(p, scene.lines[(uint)place.reference >> 1].v, place.reference & 1, -1, p->T,
               list->alpha[list->first][list->lane]);
  list->last = place;
  list->first = list_slot(list, 1);
  --list->count;
  list->alive &= RS_MASK(p->T >= scene.min_transmittance);
}

// What comes next, of which the least that a ray asks for is done: this pass goes on, another one
// from a candidate on, or nothing.
#define RS_READ_ON 0u
#define RS_RESUME(candidate) (1u + (candidate))
#define RS_NOTHING 0xffffffffu

// The least of the work-items' numbers.
uint group_least(__local ForwardMemory* memory, const int lane, const uint number) {
#if SUBGROUP
  (void)memory;
  (void)lane;
  return sub_group_reduce_min(number);
#else
  if (lane == 0) memory->found_first[0] = 0xffffffffu;
  rs_group_barrier();
  atomic_min(&memory->found_first[0], number);
  rs_group_barrier();
  return memory->found_first[0];
#endif
}

// Blends what is ready: with a stream the hits of one Gaussian, which is the nearest of all rays
// that it waits for, else all there is. Returns whether any ray had one.
RS_GROUP_INLINE bool group_blend_lists(__local ForwardMemory* memory,
                                       const float bound,
                                       const PacketScene scene,
                                       HitList* list,
                                       PacketState* p,
                                       HitStream* stream) {
#if KEEP_HITS
  const int lane = list->lane;
  const bool ready = list_ready(list, scene, p, bound);
  // The first in the list: rays that are farther on in it wait for the others, and most hits of a
  // Gaussian share a row.
  const uint own = ready ? list_candidate(list, 0) : RS_NOTHING;
  const uint common = group_least(memory, lane, own);
  const bool any = common != RS_NOTHING;
  if (any && lane == 0) memory->taken = group_push(memory, scene.references[common], 0, stream);
  rs_group_barrier();
  const bool mine = ready && own == common;
  if (any) group_stream_set(stream, lane, memory->taken, mine ? p->T : 0.0f);
  if (mine) list_blend(list, scene, p);
  return any;
#else
  (void)memory;
  (void)stream;
  while (list_ready(list, scene, p, bound)) list_blend(list, scene, p);
  return false;
#endif
}

// Traces the rays that are `traced`. Returns whether the ray lost a hit to max_hits. One loop: what
// it does in a turn depends on what the rays have found.
RS_GROUP_INLINE bool group_in_passes(__local ForwardMemory* memory,
                                     GroupCandidates* candidates,
                                     const int lane,
                                     const bool traced,
                                     const PacketScene scene,
                                     PacketState* p,
                                     HitStream* stream) {
  HitList list = {memory->open.key, memory->open.alpha, memory->open.before, lane};
  list.last.key = -1.0f;
  list.last.reference = -1;
  list.alive = traced ? -1 : 0;
  list.capped = false;
  list.resume = candidates->begin;
  uint next = group_least(memory, lane, list.alive ? RS_RESUME(list.resume) : RS_NOTHING);
  bool reads = true;
  float bound = INFINITY;
  while (next != RS_NOTHING) {
    if (next != RS_READ_ON) {
      // Candidates before all that were lost have been blended, or no ray meets them.
      list_clear(&list);
      candidates->read = next - RS_RESUME(0);
      candidates->queued = candidates->taken = 0;
    }
    group_fetch_boxes(memory, candidates, lane, reads && group_wants_boxes(candidates));
    const int queued = (int)(candidates->queued - candidates->taken);
    const int batch = reads ? min(queued, RS_GROUP_BATCH) : 0;
    group_list_batch(memory, candidates, batch, scene, p, &list);
    if (reads) bound = group_bound(memory, candidates, batch, scene);
    candidates->taken += batch;
    reads = !group_blend_lists(memory, bound, scene, &list, p, stream);
    // What lies behind a hit that was lost is not for this pass. (Without branches: by those LLVM
    // 18 gives up within PoCL 6, "Instruction Combining did not reach a fixpoint".)
    const bool waits = (list.lost.key < bound) & (list.count == 0);
    const bool searches = (list.alive != 0) & (bound < INFINITY) & !waits;
    const uint then = list.alive && list.lost.key < INFINITY ? RS_RESUME(list.resume) : RS_NOTHING;
    next = group_least(memory, lane, !reads || searches ? RS_READ_ON : then);
  }
  return list.capped;
}

#endif
