// SPDX-License-Identifier: Apache-2.0
// Hits of one ray that are not blended yet, in no order. They are noted as the products of a
// meeting and evaluated LANES at a time later: a block holds about one hit, too few for vectors.
// Order by ranks: every key is compared with all others, LANES at a time, O(n^2 / LANES) without
// a branch. Equal keys are ordered by the index of the Gaussian.
#ifndef RS_TRACE_RAY_PENDING_H
#define RS_TRACE_RAY_PENDING_H

#include "trace/ray_block.h"

// Room for hits, a multiple of LANES and at least 4 * LANES.
#ifndef RAY_HITS
#define RAY_HITS 64
#endif
// Vectors of an evaluation begin anywhere and reach over the last entry.
#define RS_PENDING_ROOM (RAY_HITS + LANES)

typedef union {
  fv v[RS_PENDING_ROOM / LANES];
  float s[RS_PENDING_ROOM];
} PendingFloats;

typedef union {
  iv v[RAY_HITS / LANES];
  int s[RAY_HITS];
} PendingInts;

typedef struct {
  // Until an entry is evaluated these three hold cross2, direction2 and along.
  PendingFloats key;
  float alpha[RS_PENDING_ROOM];
  float peak[RS_PENDING_ROOM];
  float origin2[RS_PENDING_ROOM];
  float opacity[RS_PENDING_ROOM];
#if ADAPTIVE_RADIUS
  float half_quantile[RS_PENDING_ROOM];
#endif
  uint slot[RAY_HITS];  // block times LANES plus lane
  uint index[RAY_HITS];
  // The colour of SH degree 0, read when the hit is found, so that blending never waits for memory.
  float4 color[RAY_HITS];
  ushort order[RAY_HITS];  // filled by pending_sort
  int size;
  int evaluated;  // entries before this one are
} Pending;

// The hits that a walk looks for, both ends inclusive.
typedef struct {
  float begin, end;  // keys
  uint begin_index;  // least index that counts at `begin`
  uint end_index;    // greatest index that counts at `end`
  bool ties;         // whether the indices leave out any
} PendingRange;

// Entries keep their sequence; what is not moved is written over.
void pending_move(Pending* pending, int from, int to) {
  pending->key.s[to] = pending->key.s[from];
  pending->alpha[to] = pending->alpha[from];
  pending->peak[to] = pending->peak[from];
  pending->slot[to] = pending->slot[from];
  pending->index[to] = pending->index[from];
  pending->color[to] = pending->color[from];
}

void pending_append(
    Pending* pending, const BlockMeeting* meeting, __global const fv* block, uint slot, uint lane) {
  const int n = pending->size++;
  pending->key.s[n] = meeting->cross2.s[lane];
  pending->alpha[n] = meeting->direction2.s[lane];
  pending->peak[n] = meeting->along.s[lane];
#if !PEAK_ORDER
  pending->origin2[n] = meeting->origin2.s[lane];
#endif
  pending->opacity[n] = met_opacity(meeting, block, lane);
#if ADAPTIVE_RADIUS
  pending->half_quantile[n] = met_half_quantile(meeting, block, lane);
#endif
  pending->slot[n] = slot;
  pending->index[n] = block_index(block, lane);
  pending->color[n] = block_color(block, lane);
}

#define RS_PENDING_LOAD(values, i) (*(const rs_private_unaligned*)((values) + (i)))
#define RS_PENDING_STORE(values, i, v) (*(rs_private_unaligned*)((values) + (i)) = (v))
typedef fv rs_private_unaligned __attribute__((aligned(4)));

// Key, alpha and peak of all new entries; drops those out of range. Returns `remaining` times their
// 1 - alpha.
float pending_evaluate(Pending* pending,
                       const PendingRange* range,
                       float half_quantile,
                       float remaining) {
  int to = pending->evaluated;
  for (int i = pending->evaluated; i < pending->size; i += LANES) {
    const fv cross2 = RS_PENDING_LOAD(pending->key.s, i);
    const fv direction2 = RS_PENDING_LOAD(pending->alpha, i);
    const fv along = RS_PENDING_LOAD(pending->peak, i);
    const fv opacity = RS_PENDING_LOAD(pending->opacity, i);
#if ADAPTIVE_RADIUS
    const fv exponent = RS_PENDING_LOAD(pending->half_quantile, i);
#else
    const fv exponent = (fv)(half_quantile);
#endif
    const fv reciprocal = 1.0f / direction2;
    const fv peak = -along * reciprocal;
#if PEAK_ORDER
    const fv key = peak;
    iv good = RS_MASK(key >= range->begin) & RS_MASK(key <= range->end);
#else
    // The far root times |d'|^2, then the near root by Viete's formula.
    const fv root = sqrt(max(direction2 - cross2, (fv)(0.0f))) - along;
    const fv key = (RS_PENDING_LOAD(pending->origin2, i) - 1.0f) / root;
    iv good = RS_MASK(root > 0.0f) & RS_MASK(key >= range->begin) & RS_MASK(key <= range->end);
#endif
    const fv alpha = opacity * rs_exp(-exponent * cross2 * reciprocal);
    RS_PENDING_STORE(pending->key.s, i, key);
    RS_PENDING_STORE(pending->alpha, i, alpha);
    RS_PENDING_STORE(pending->peak, i, peak);
    const int count = min(LANES, pending->size - i);
    const uint all = 0xffffffffu >> (32 - count);
    const uint bits = rs_lane_bits(good) & all;
    if (bits == all && to == i && !range->ties) {
      for (int k = i; k < i + count; ++k) remaining *= 1.0f - pending->alpha[k];
      to += count;
      continue;
    }
    for (int k = i; k < i + count; ++k) {
      if ((bits >> (k - i) & 1) == 0) continue;
      const float own = pending->key.s[k];
      if (own == range->begin && pending->index[k] < range->begin_index) continue;
      if (own == range->end && pending->index[k] > range->end_index) continue;
      remaining *= 1.0f - pending->alpha[k];
      pending_move(pending, k, to++);
    }
  }
  pending->size = pending->evaluated = to;
  return remaining;
}

// How many of keys[0..size) are less than each of `own`.
iv pending_ranks(const float* keys, int size, fv own) {
  iv less = (iv)(0);
  for (int i = 0; i < size; ++i) less -= RS_MASK((fv)(keys[i]) < own);
  return less;
}

// order[r] = entry with the r-th smallest (key, index). All entries must be evaluated.
void pending_sort(Pending* pending) {
  const int size = pending->size;
  const int vectors = (size + LANES - 1) / LANES;
  for (int i = size; i < vectors * LANES; ++i) pending->key.s[i] = INFINITY;
  PendingInts rank;
  for (int j = 0; j < vectors; ++j) {
    rank.v[j] = pending_ranks(pending->key.s, size, pending->key.v[j]);
  }
  int sum = 0;
  for (int i = 0; i < size; ++i) {
    sum += rank.s[i];
    pending->order[rank.s[i]] = (ushort)i;
  }
  if (2 * sum == size * (size - 1)) return;
  // Equal keys share a rank.
  for (int i = 0; i < size; ++i) {
    const float key = pending->key.s[i];
    const uint index = pending->index[i];
    int j = i;
    for (; j > 0; --j) {
      const int other = pending->order[j - 1];
      if (pending->key.s[other] < key ||
          (pending->key.s[other] == key && pending->index[other] < index))
        break;
      pending->order[j] = (ushort)other;
    }
    pending->order[j] = (ushort)i;
  }
}

// What is kept of the k-th nearest hit; call pending_sort first.
float pending_key(const Pending* p, const int k) { return p->key.s[p->order[k]]; }
float pending_alpha(const Pending* p, const int k) { return p->alpha[p->order[k]]; }
float pending_peak(const Pending* p, const int k) { return p->peak[p->order[k]]; }
uint pending_slot(const Pending* p, const int k) { return p->slot[p->order[k]]; }
uint pending_index(__global const fv* blocks, const Pending* p, const int k) {
  (void)blocks;
  return p->index[p->order[k]];
}
float4 pending_color(__global const fv* blocks, const Pending* p, const int k) {
  (void)blocks;
  return p->color[p->order[k]];
}

// Keeps the entries whose keys are at most `end`.
void pending_cut(Pending* pending, float end) {
  int kept = 0;
  for (int i = 0; i < pending->size; ++i) {
    if (pending->key.s[i] <= end) pending_move(pending, i, kept++);
  }
  pending->size = pending->evaluated = kept;
}

// Keeps the entries order[first..first + count) and returns the product of their 1 - alpha.
float pending_keep(Pending* pending, int first, int count) {
  uint stays[RAY_HITS / 32 + 1];
  for (int k = 0; k < RAY_HITS / 32 + 1; ++k) stays[k] = 0;
  for (int k = first; k < first + count; ++k) {
    const uint i = pending->order[k];
    stays[i / 32] |= 1u << i % 32;
  }
  float product = 1.0f;
  int kept = 0;
  for (int i = 0; i < pending->size; ++i) {
    if ((stays[i / 32] >> i % 32 & 1) == 0) continue;
    product *= 1.0f - pending->alpha[i];
    pending_move(pending, i, kept++);
  }
  pending->size = pending->evaluated = kept;
  return product;
}

#endif
