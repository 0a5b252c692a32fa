// SPDX-License-Identifier: Apache-2.0
// Blending a packet without sorting its rays: one row per Gaussian. The transmittance in front of a
// hit is the product of 1 - alpha over the nearer hits of its ray, in any order, so a row keeps
// that product per lane, and rows that some lanes meet in one order and some in the other are
// compared once, lane by lane. Rows are opened by their nearest key (over the lanes), as soon as
// nothing that comes later in the list can be nearer; a row is settled when its farthest key lies
// before the nearest of a new one. Cost: candidates + pairs of rows that overlap in depth, a few
// vector operations each; exact.
#ifndef RS_TRACE_PACKET_ROWS_H
#define RS_TRACE_PACKET_ROWS_H

#include "parallel/prefetch.h"
#include "trace/candidates.h"
#include "trace/hit_stream.h"
#include "trace/packet_state.h"

// Rows waiting or open at once.
#ifndef PENDING
#define PENDING 96
#endif

// Candidates tested before the rows found are opened, a multiple of RS_TOGETHER. Their tests depend
// on nothing, so a processor runs several at once; a branch per candidate would make each wait for
// the one before.
#define RS_BATCH (PACKET > 1 ? 8 : 1)

typedef struct {
  fv key[PENDING];
  fv alpha[PENDING];        // 0 in lanes that miss
  fv before[PENDING];       // product over the nearer hits so far
  float last_key[PENDING];  // farthest key of the lanes that hit
  uint reference[PENDING];
  uint number[PENDING];  // in order of opening
  uint stream_row[PENDING];
} Rows;

// Slots of rows: a stack of free ones, the waiting ones by nearest key, farthest first, and the
// open ones in no order.
typedef struct {
  ushort free[PENDING];
  ushort waiting[PENDING];
  float first_key[PENDING];  // of waiting[i]
  ushort open[PENDING];
  int free_count, waiting_count, open_count;
} Slots;

// Tests `size` candidates, fewer than there are free slots; returns how many any lane of `among`
// hits: the slots of their rows, and their nearest keys. Both take one value more than there are
// candidates.
__attribute__((always_inline)) int rows_find(Rows* rows,
                                             Slots* slots,
                                             const PacketState* p,
                                             const PacketScene scene,
                                             const uint* candidates,
                                             const int size,
                                             const iv among,
                                             ushort* found,
                                             float* first_key) {
  int count = 0;
  for (int j = 0; j < size; j += RS_TOGETHER) {
    uint reference[RS_TOGETHER];
    float quantile[RS_TOGETHER];
    uint general = 0;
#pragma unroll
    for (int i = 0; i < RS_TOGETHER; ++i) {
      const uint k = candidates[min(j + i, size - 1)];  // the last again where there are no more
      reference[i] = scene.references[k];
      quantile[i] = scene.limits[k].y;
      general |= reference[i] & 1;
    }
    PacketHit hits[RS_TOGETHER];
    if (general) {
      for (int i = 0; i < RS_TOGETHER; ++i)
        hits[i] = packet_hit(p, scene, reference[i], quantile[i], among);
    } else {
      packet_hits(p, scene.lines, reference, quantile, RS_TOGETHER, false, among, hits);
    }
    float first[RS_TOGETHER], last[RS_TOGETHER];
#pragma unroll
    for (int i = 0; i < RS_TOGETHER; ++i) {
      last[i] = rs_lane_max(select((fv)(0.0f), hits[i].key, hits[i].hit));
      first[i] = rs_lane_min(select((fv)(INFINITY), hits[i].key, hits[i].hit));
    }
#pragma unroll
    for (int i = 0; i < RS_TOGETHER; ++i) {
      // Kept only where a lane hits, without a branch.
      const ushort slot = slots->free[slots->free_count - 1];
      rows->key[slot] = rs_as_float(rs_as_int(hits[i].key) & 0x7fffffff);
      rows->alpha[slot] = hits[i].alpha;
      rows->last_key[slot] = last[i];
      rows->reference[slot] = reference[i];
      found[count] = slot;
      first_key[count] = first[i];
      const int kept = j + i < size && rs_any(hits[i].hit) ? 1 : 0;
      count += kept;
      slots->free_count -= kept;
    }
  }
  return count;
}

// Returns how many rows it moved.
int row_wait(Slots* slots, const ushort slot, const float first_key) {
  int i = slots->waiting_count++;
  for (; i > 0 && slots->first_key[i - 1] < first_key; --i) {
    slots->first_key[i] = slots->first_key[i - 1];
    slots->waiting[i] = slots->waiting[i - 1];
  }
  slots->first_key[i] = first_key;
  slots->waiting[i] = slot;
  return slots->waiting_count - 1 - i;
}

// Blends an open row whose place is known; `settled` is the product over such rows per lane.
void row_settle(const Rows* rows,
                const ushort slot,
                const PacketScene scene,
                PacketState* p,
                fv* settled,
                HitStream* stream) {
  const uint reference = rows->reference[slot];
  const fv alpha = rows->alpha[slot];
  const fv before = rows->before[slot];
  const iv mine = RS_MASK(alpha > 0.0f) & RS_MASK(before >= scene.min_transmittance);
  packet_blend(p, scene.lines[reference >> 1].v, reference & 1, mine, before, alpha);
  *settled -= *settled * alpha;
#if KEEP_HITS
  stream_set(stream, rows->stream_row[slot], select((fv)(0.0f), before, mine));
#else
  (void)stream;
#endif
}

// False when the packet needs more rows at once or a wider window than there is room for, or a ray
// has more than max_hits hits: packet_sorted.h has no such limits.
bool trace_in_rows(Candidates* candidates,
                   const PacketScene scene,
                   PacketState* p,
                   HitStream* stream) {
  Rows rows;
  Slots slots;
  slots.waiting_count = slots.open_count = 0;
  slots.free_count = PENDING;
  for (int i = 0; i < PENDING; ++i) slots.free[i] = i;
  fv settled = (fv)(1.0f);
  uint opened = 0;
  iv alive = p->valid;
  uint next = candidates_next(candidates);
  while (rs_any(alive)) {
    uint batch[RS_BATCH];
    int size = 0;
    for (; size < RS_BATCH && next != candidates->end; ++size) {
      batch[size] = next;
      RS_PREFETCH_READ(scene.lines + (scene.references[next] >> 1));
      next = candidates_next(candidates);
    }
    if (slots.free_count <= size) return false;
    float first_key[RS_BATCH + 1];
    ushort found[RS_BATCH + 1];
    const int found_count =
        rows_find(&rows, &slots, p, scene, batch, size, alive, found, first_key);
    RS_TALLY(p, RS_TALLY_ROUNDS, 1);
    RS_TALLY(p, RS_TALLY_TESTED, (size + RS_TOGETHER - 1) / RS_TOGETHER * RS_TOGETHER);
    RS_TALLY(p, RS_TALLY_FOUND, found_count);
    for (int j = 0; j < found_count; ++j) {
      const int passed = row_wait(&slots, found[j], first_key[j]);
      RS_TALLY(p, RS_TALLY_ORDERED, passed);
      (void)passed;
    }
    const bool draining = next == candidates->end;
    const float bound = draining ? INFINITY : scene.limits[next].x;
    while (slots.waiting_count > 0 && slots.first_key[slots.waiting_count - 1] <= bound) {
      const float first_key = slots.first_key[--slots.waiting_count];
      const ushort slot = slots.waiting[slots.waiting_count];
      const uint reference = rows.reference[slot];
      const fv alpha = rows.alpha[slot];
      // Compared as integers (keys are not negative), less one where an equal key of a Gaussian
      // with a higher index counts as farther.
      const iv order = rs_as_int(rows.key[slot]);
      fv before = (fv)(1.0f);
      uint oldest = opened;
      int left = 0;
      const int open_count = slots.open_count;
      RS_TALLY(p, RS_TALLY_OPENED, 1);
      RS_TALLY(p, RS_TALLY_COMPARED, open_count);
      for (int i = 0; i < open_count; ++i) {
        const ushort other = slots.open[i];
        if (rows.last_key[other] < first_key) {
          row_settle(&rows, other, scene, p, &settled, stream);
          slots.free[slots.free_count++] = other;
          continue;
        }
        slots.open[left++] = other;
        const fv other_before = rows.before[other];
        const iv nearer = RS_MASK(order - (iv)(reference < rows.reference[other] ? 1 : 0) <
                                  rs_as_int(rows.key[other]));
        rows.before[other] = other_before - select((fv)(0.0f), other_before * alpha, nearer);
        before -= select(before * rows.alpha[other], (fv)(0.0f), nearer);
        oldest = min(oldest, rows.number[other]);
      }
      if (left < open_count) {
        alive = p->valid & RS_MASK(p->T >= scene.min_transmittance);
        slots.open_count = left;
        if (!rs_any(alive)) break;
      }
      rows.before[slot] = before * settled;
      rows.number[slot] = opened;
      slots.open[left] = slot;
      slots.open_count = left + 1;
#if KEEP_HITS
      if (opened - oldest > WINDOW - 1) return false;
      rows.stream_row[slot] = stream_push(stream, reference, opened - oldest);
#endif
      ++opened;
    }
    if (draining) break;
  }
  for (int i = 0; i < slots.open_count; ++i)
    row_settle(&rows, slots.open[i], scene, p, &settled, stream);
  return !rs_any(RS_MASK(p->hits > scene.max_hits));
}

#endif
