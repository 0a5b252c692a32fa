// SPDX-License-Identifier: Apache-2.0
// Blending a packet through a sorted list per lane, without limits on hits: exact for any
// PENDING >= 1. packet_rows.h does the packets that fit it, which is nearly all, in less time.
// Lanes that miss a candidate carry alpha 0 at a virtual depth, which keeps neighbouring lanes
// aligned; whatever lies before a candidate's bound in all lanes is blended first. If more than
// PENDING hits are needed at once the farthest are dropped and found again in another pass that
// continues behind the last blended (depth, reference).
#ifndef RS_TRACE_PACKET_SORTED_H
#define RS_TRACE_PACKET_SORTED_H

#include "trace/candidates.h"
#include "trace/hit_stream.h"
#include "trace/packet_state.h"

typedef struct {
  fv key[PENDING];
  fv alpha[PENDING];  // 0 in lanes that miss
  iv reference[PENDING];
  int head, size;
} Pending;

// A place in the order of hits, per lane.
typedef struct {
  fv key;
  iv reference;
} Place;

iv comes_before(const fv key, const iv reference, const fv other_key, const iv other_reference) {
  return RS_MASK(key < other_key) |
         (RS_MASK(key == other_key) & RS_MASK(reference < other_reference));
}

void move_to_front(Pending* pending) {
  for (int i = pending->head; i < pending->size; ++i) {
    pending->key[i - pending->head] = pending->key[i];
    pending->alpha[i - pending->head] = pending->alpha[i];
    pending->reference[i - pending->head] = pending->reference[i];
  }
  pending->size -= pending->head;
  pending->head = 0;
}

// Exchanges the new hit for the last of a full list where that is farther, and takes the last off.
// Returns true when a hit was lost; `limit` becomes the nearest hit lost.
bool push_out_last(Pending* pending, fv* key, fv* alpha, iv* reference, Place* limit) {
  const int last = --pending->size;
  const fv last_key = pending->key[last], last_alpha = pending->alpha[last];
  const iv last_reference = pending->reference[last];
  const iv nearer = comes_before(*key, *reference, last_key, last_reference);
  const fv out_key = select(*key, last_key, nearer);
  const iv out_reference = select(*reference, last_reference, nearer);
  const iv lost = RS_MASK(select(*alpha, last_alpha, nearer) > 0.0f) &
                  comes_before(out_key, out_reference, limit->key, limit->reference);
  limit->key = select(limit->key, out_key, lost);
  limit->reference = select(limit->reference, out_reference, lost);
  *key = select(last_key, *key, nearer);
  *alpha = select(last_alpha, *alpha, nearer);
  *reference = select(last_reference, *reference, nearer);
  return rs_any(lost);
}

void insert_sorted(Pending* pending, fv key, fv alpha, iv reference) {
  int j = pending->size++;
  while (j > pending->head) {
    const fv other_key = pending->key[j - 1];
    const iv other_reference = pending->reference[j - 1];
    const iv before = comes_before(key, reference, other_key, other_reference);
    if (!rs_any(before)) break;
    const fv other_alpha = pending->alpha[j - 1];
    pending->key[j] = select(key, other_key, before);
    pending->alpha[j] = select(alpha, other_alpha, before);
    pending->reference[j] = select(reference, other_reference, before);
    key = select(other_key, key, before);
    alpha = select(other_alpha, alpha, before);
    reference = select(other_reference, reference, before);
    --j;
  }
  pending->key[j] = key;
  pending->alpha[j] = alpha;
  pending->reference[j] = reference;
}

// Blends entry h of the list, which may hold another Gaussian in every lane.
void blend_entry(const Pending* pending,
                 const int h,
                 const iv active,
                 const PacketScene scene,
                 PacketState* p,
                 HitStream* stream) {
  uint rest = rs_lane_bits(active);
  while (rest != 0) {
    const uint reference = ((__private const uint*)&pending->reference[h])[rs_lowest_bit(rest)];
    const iv mine = active & RS_MASK(pending->reference[h] == (iv)(reference));
    rest &= ~rs_lane_bits(mine);
#if KEEP_HITS
    stream_set(stream, stream_push(stream, reference, 0), select((fv)(0.0f), p->T, mine));
#else
    (void)stream;
#endif
    packet_blend(p, scene.lines[reference >> 1].v, reference & 1, mine, p->T, pending->alpha[h]);
  }
}

// Returns the lanes that lost a hit to max_hits.
iv trace_sorted(Candidates* candidates,
                const PacketScene scene,
                PacketState* p,
                HitStream* stream) {
  Pending pending;
  iv capped = (iv)(0);
  iv alive = p->valid;
  Place last = {(fv)(-1.0f), (iv)(-1)};  // blended
  Place start = last;                    // of the pass: behind it
  bool dropped;
  bool first_pass = true;
  do {
    dropped = false;
    Place limit = {(fv)(INFINITY), (iv)(0x7fffffff)};  // nearest hit dropped
    pending.head = pending.size = 0;
    candidates_restart(candidates);
    for (;;) {
      const uint k = candidates_next(candidates);
      const bool draining = k == candidates->end;
      const float bound = draining ? INFINITY : scene.limits[k].x;
      while (pending.head < pending.size &&
             (draining || rs_all(RS_MASK(pending.key[pending.head] <= bound)))) {
        const int h = pending.head++;
        iv active = RS_MASK(pending.alpha[h] > 0.0f) & alive;
        if (dropped)
          active &= comes_before(pending.key[h], pending.reference[h], limit.key, limit.reference);
        if (!rs_any(active)) continue;
        capped |= active & RS_MASK(p->hits >= scene.max_hits);
        active &= RS_MASK(p->hits < scene.max_hits);
        last.key = select(last.key, pending.key[h], active);
        last.reference = select(last.reference, pending.reference[h], active);
        blend_entry(&pending, h, active, scene, p, stream);
        alive &= RS_MASK(p->T >= scene.min_transmittance) & ~capped;
      }
      if (draining || !rs_any(alive)) break;

      const uint reference = scene.references[k];
      const PacketHit found = packet_hit(p, scene, reference, scene.limits[k].y, alive);
      fv key = found.key;
      iv hit = found.hit;
      if (!first_pass) hit &= ~comes_before(key, (iv)(reference), start.key, start.reference + 1);
      if (!rs_any(hit)) continue;
      fv alpha = select((fv)(0.0f), found.alpha, hit);
      // Later passes keep misses behind every hit, so that a full list always makes progress.
      key = select(first_pass ? fmax(key, (fv)(bound)) : (fv)(INFINITY), key, hit);
      iv id = (iv)(reference);
      if (pending.size == PENDING && pending.head > 0) move_to_front(&pending);
      if (pending.size == PENDING && push_out_last(&pending, &key, &alpha, &id, &limit))
        dropped = true;
      insert_sorted(&pending, key, alpha, id);
    }
    start = last;
    first_pass = false;
  } while (dropped && rs_any(alive));
  return capped;
}

#endif
