// SPDX-License-Identifier: Apache-2.0
// The walk of one arbitrary ray on GPUs, in place of ray_pending.h and ray_walk.h: the nearest KEPT
// hits behind the last one blended are kept in order, in local memory, a column per work-item of a
// group of GROUP. A walk through the tree ends with them; they are blended, and where there may be
// more behind them another walk follows. Once they are KEPT, or enough to end the ray, the farthest
// of them is the end of the walk. Nothing but the trail of the walk (tree_walk.h) lies in private
// memory. What is found and its order are those of ray_walk.h. Cost per ray: hits / KEPT + 1 walks.
//
// The walk itself is in ray_walk.h.
#ifndef RS_TRACE_RAY_NEAREST_H
#define RS_TRACE_RAY_NEAREST_H

#include "trace/ray_block.h"

typedef struct {
  float key[KEPT][GROUP];
  float alpha[KEPT][GROUP];
#if !PEAK_ORDER
  float peak[KEPT][GROUP];
#endif
  uint slot[KEPT][GROUP];  // block times LANES plus lane
  float t_max[GROUP];
} HitMemory;

// The nearest hits of one ray.
typedef struct {
  __local HitMemory* memory;
  int column;
  int size;
  float remaining;  // at least what is left of the light behind those kept
} Pending;

RS_INLINE float pending_key(const Pending* p, const int k) { return p->memory->key[k][p->column]; }
RS_INLINE float pending_alpha(const Pending* p, const int k) {
  return p->memory->alpha[k][p->column];
}
RS_INLINE uint pending_slot(const Pending* p, const int k) { return p->memory->slot[k][p->column]; }
#if PEAK_ORDER
RS_INLINE float pending_peak(const Pending* p, const int k) { return pending_key(p, k); }
#else
RS_INLINE float pending_peak(const Pending* p, const int k) {
  return p->memory->peak[k][p->column];
}
#endif

// Where the ray ends is needed between its walks only, and a wave of 16 has no register for it.
RS_INLINE void park_end(const Pending* p, const float t_max) {
  p->memory->t_max[p->column] = t_max;
}

RS_INLINE float parked_end(const Pending* p) { return p->memory->t_max[p->column]; }

// The number of the Gaussian of the k-th nearest hit.
RS_INLINE uint pending_index(__global const fv* blocks, const Pending* p, const int k) {
  const uint slot = pending_slot(p, k);
  return block_index(blocks + (size_t)(slot / LANES) * RS_BLOCK_VECTORS, slot % LANES);
}

// The colour of SH degree 0 of the k-th nearest hit.
RS_INLINE float4 pending_color(__global const fv* blocks, const Pending* p, const int k) {
  const uint slot = pending_slot(p, k);
  return block_color(blocks + (size_t)(slot / LANES) * RS_BLOCK_VECTORS, slot % LANES);
}

// Puts a hit where it belongs among those kept, the farthest of which falls out where there are
// KEPT.
RS_INLINE void pending_insert(__global const fv* blocks,
                              Pending* p,
                              const float key,
                              const float alpha,
                              const float peak,
                              const uint slot,
                              const uint index) {
  __local HitMemory* m = p->memory;
  const int c = p->column;
  int k = p->size;
  for (; k > 0; --k) {
    const float other = m->key[k - 1][c];
    if (other < key || (other == key && pending_index(blocks, p, k - 1) < index)) break;
    if (k == KEPT) continue;
    m->key[k][c] = other;
    m->alpha[k][c] = m->alpha[k - 1][c];
#if !PEAK_ORDER
    m->peak[k][c] = m->peak[k - 1][c];
#endif
    m->slot[k][c] = m->slot[k - 1][c];
  }
  if (k == KEPT) return;
  m->key[k][c] = key;
  m->alpha[k][c] = alpha;
#if !PEAK_ORDER
  m->peak[k][c] = peak;
#else
  (void)peak;
#endif
  m->slot[k][c] = slot;
  p->size = min(p->size + 1, KEPT);
  p->remaining *= 1.0f - alpha;
}

// Drops what lies behind the hit that ends the ray; true when there is one.
RS_INLINE bool pending_end(Pending* p, const float min_transmittance, const float transmittance) {
  float left = transmittance;
  for (int k = 0; k < p->size; ++k) {
    left *= 1.0f - pending_alpha(p, k);
    if (left < min_transmittance) {
      p->size = k + 1;
      return true;
    }
  }
  p->remaining = left;  // of hits that fell out since the last time it held too much
  return false;
}

#endif
