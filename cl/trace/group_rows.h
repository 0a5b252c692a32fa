// SPDX-License-Identifier: Apache-2.0
// Blending a packet of work-items without sorting its rays: the rows of packet_rows.h, spread over
// a work-group. Candidates are taken in batches. All work-items test one candidate at a time, each
// against its own ray; of a candidate that some ray hits its nearest and farthest key stay, and its
// row waits until nothing that comes later in the list can be nearer. Rows that wait are ordered by
// counting, a row per work-item; those that may open are opened one after the other, meeting their
// Gaussian again, which is cheaper than to keep what every ray found. An open row keeps key, alpha
// and the product over nearer hits per ray, each work-item in its own column.
//
// The stream has the rows in the order in which they are settled, and a row's window counts those
// settled while it was open: so the backward pass has no more rows open at once than this one,
// however long one of them stays.
#ifndef RS_TRACE_GROUP_ROWS_H
#define RS_TRACE_GROUP_ROWS_H

#include "trace/group.h"
#include "trace/hit_stream.h"
#include "trace/packet_state.h"

// Candidates of a batch.
#define RS_GROUP_BATCH (GROUP < 16 ? GROUP : 16)
// Candidates found and not tested yet: a power of two.
#define RS_GROUP_QUEUE (2 * GROUP)
// Rows that wait, those of a batch included. More rays meet more Gaussians at once.
#ifndef WAITING
#define WAITING ((GROUP > 32 ? 128 : 64) << (CROWDED ? 1 : 0))
#endif

// A row has for each ray the key, alpha, 0 where it misses, and the product over the nearer hits so
// far.
typedef struct {
  float key[OPEN_LOCAL][GROUP];
  float alpha[OPEN_LOCAL][GROUP];
  float before[OPEN_LOCAL][GROUP];
  float last_key[OPEN];  // farthest key of the rays that hit
  uint reference[OPEN];
  uint settled[OPEN];  // rows settled when it was opened
  uint stream_row[OPEN];
} OpenRows;

// The same of the rows beyond OPEN_LOCAL, in private memory.
typedef struct {
  float key[RS_OPEN_OWN];
  float alpha[RS_OPEN_OWN];
  float before[RS_OPEN_OWN];
} OwnRows;

// Rows that wait, nearest first.
typedef struct {
  float first_key[WAITING];
  float last_key[WAITING];
  uint candidate[WAITING];
} WaitingRows;

// Waiting rows that one work-item puts in order.
#define RS_WAITING_EACH ((WAITING + GROUP - 1) / GROUP)

typedef struct {
  OpenRows open;
  WaitingRows waiting;
  uint found_first[RS_GROUP_BATCH];  // keys of a batch, as integers
  uint found_last[RS_GROUP_BATCH];
  uint queue[RS_GROUP_QUEUE];
  uint batch_reference[RS_GROUP_BATCH];
  float batch_quantile[RS_GROUP_BATCH];
  uint words[2];
  uint taken;
  uint alive;
#if KEEP_HITS
  uint2 stream_end;  // chunk of the stream and what is used of it, for work-item 0
#endif
} ForwardMemory;

// The way through the candidate list of the tile; the same in every work-item.
typedef struct {
  __global const float* boxes;  // planes of `stride`: x0, y0, x1, y1
  size_t stride;
  uint begin, end;       // of the list
  float x0, y0, x1, y1;  // outermost rays of the packet
  uint read;             // up to here the list is in the queue
  uint queued, taken;    // entries of the queue, counted from the start
} GroupCandidates;

// Reads on, where the work-items are told to and the list goes on: a box each.
RS_GROUP_INLINE void group_fetch_boxes(__local ForwardMemory* memory,
                                       GroupCandidates* c,
                                       const int lane,
                                       const bool reads) {
  const uint k = c->read + lane;
  bool meets = false;
  if (reads && k < c->end) {
    __global const float* box = c->boxes + k;
    meets = box[0] <= c->x1 && box[c->stride] <= c->y1 && box[2 * c->stride] >= c->x0 &&
            box[3 * c->stride] >= c->y0;
  }
  const ulong bits = rs_group_bits(memory->words, lane, meets);
  const uint place = (uint)popcount(bits & ((1ul << lane) - 1));
  if (meets) memory->queue[(c->queued + place) % RS_GROUP_QUEUE] = k;
  c->queued += (uint)popcount(bits);
  c->read += reads ? GROUP : 0;
}

// Whether the queue lacks a batch that the list still has.
bool group_wants_boxes(const GroupCandidates* c) {
  return c->queued - c->taken < RS_GROUP_BATCH && c->read < c->end;
}

// Reads on until there is a batch, or the list ends.
RS_GROUP_INLINE void group_fetch(__local ForwardMemory* memory,
                                 GroupCandidates* c,
                                 const int lane) {
  while (group_wants_boxes(c)) group_fetch_boxes(memory, c, lane, true);
}

float group_waiting_key(const __local ForwardMemory* memory,
                        const int begin,
                        const int waiting,
                        const int i) {
  return i < waiting ? memory->waiting.first_key[begin + i]
                     : as_float(memory->found_first[i - waiting]);
}

// The n-th of the `total` rows that a work-item puts in order; never beyond the last.
int group_waiting_row(const int lane, const int n, const int total) {
  return max(min(lane + n * GROUP, total - 1), 0);
}

// Neighbouring work-items write neighbouring words.
void group_stream_set(const HitStream* stream,
                      const int lane,
                      const uint row,
                      const float transmittance) {
  if (row != RS_NO_ROW) stream->transmittance[(size_t)row * GROUP + lane] = transmittance;
}

// Blends an open row whose place is known; `settled` is the product over such rows.
void group_settle(__local OpenRows* rows,
                  const OwnRows* own,
                  const uint slot,
                  const int lane,
                  const PacketScene scene,
                  PacketState* p,
                  float* settled,
                  const HitStream* stream) {
  const uint reference = rows->reference[slot];
  const float alpha = rs_row_get(rows->alpha, own->alpha, slot, lane);
  const float before = rs_row_get(rows->before, own->before, slot, lane);
  const int mine = RS_MASK(alpha > 0.0f) & RS_MASK(before >= scene.min_transmittance);
  packet_blend(p, scene.lines[reference >> 1].v, reference & 1, mine, before, alpha);
  *settled -= *settled * alpha;
#if KEEP_HITS
  group_stream_set(stream, lane, rows->stream_row[slot], mine ? before : 0.0f);
#else
  (void)stream;
#endif
}

#if KEEP_HITS
// Reserves a place in the stream; for work-item 0, which alone knows where it ends.
uint group_push(__local ForwardMemory* memory,
                const uint reference,
                const uint window,
                HitStream* stream) {
  stream->chunk = memory->stream_end.x;
  stream->used = memory->stream_end.y;
  const uint row = stream_push(stream, reference, window);
  memory->stream_end = (uint2)(stream->chunk, stream->used);
  return row;
}

// Reserves places in the stream, for work-item 0: for the rows of the slots `closing`, which settle
// now.
void group_push_rows(__local ForwardMemory* memory,
                     RowSet closing,
                     uint settled,
                     HitStream* stream) {
  __local OpenRows* rows = &memory->open;
  for (; closing != 0; closing &= closing - 1, ++settled) {
    const uint slot = rs_first_slot(closing);
    rows->stream_row[slot] =
        group_push(memory, rows->reference[slot], settled - rows->settled[slot], stream);
  }
}
#endif

// What has become of the rows so far. Apart from OwnRows: beside what is indexed it would leave the
// registers.
typedef struct {
  float settled;      // product over the settled rows, of this work-item's ray
  uint settled_rows;  // how many these are
  RowSet open;        // slots that are taken, a bit each
  RowSet closed;      // slots that the last row closed: others may still read of them
} RowProgress;

// Fetches what the next `batch` candidates of the queue are, a work-item each: the test of one then
// waits for its line alone.
RS_GROUP_INLINE void group_stage_batch(__local ForwardMemory* memory,
                                       const GroupCandidates* candidates,
                                       const int lane,
                                       const int batch,
                                       const PacketScene scene) {
  rs_group_barrier();
  if (lane < batch) {
    const uint k = memory->queue[(candidates->taken + lane) % RS_GROUP_QUEUE];
    memory->batch_reference[lane] = scene.references[k];
    memory->batch_quantile[lane] = scene.limits[k].y;
  }
}

// Tests the next `batch` candidates of the queue against the rays that are `alive`: a work-item its
// own ray. Of each its nearest and farthest key are found afterwards. Returns whether any ray is.
RS_GROUP_INLINE bool group_test_batch(__local ForwardMemory* memory,
                                      const GroupCandidates* candidates,
                                      const int lane,
                                      const int batch,
                                      const PacketScene scene,
                                      const int alive,
                                      const PacketState* p) {
  group_stage_batch(memory, candidates, lane, batch, scene);
#if SUBGROUP
  rs_group_barrier();
#else
  if (lane < RS_GROUP_BATCH) {
    memory->found_first[lane] = as_uint(INFINITY);
    memory->found_last[lane] = 0;
  }
  if (lane == 0) memory->alive = 0;
  rs_group_barrier();
#endif
  for (int j = 0; j < batch; ++j) {
    const PacketHit hit =
        packet_hit(p, scene, memory->batch_reference[j], memory->batch_quantile[j], alive);
    // Keys are not negative: their bits are in order.
    const uint key = as_uint(hit.key) & 0x7fffffff;
#if SUBGROUP
    const uint nearest = sub_group_reduce_min(hit.hit ? key : as_uint(INFINITY));
    const uint farthest = sub_group_reduce_max(hit.hit ? key : 0u);
    if (lane == 0) {
      memory->found_first[j] = nearest;
      memory->found_last[j] = farthest;
    }
#else
    if (hit.hit) {
      atomic_min(&memory->found_first[j], key);
      atomic_max(&memory->found_last[j], key);
    }
#endif
  }
#if SUBGROUP
  const bool some_alive = sub_group_any(alive != 0);
  rs_group_barrier();
  return some_alive;
#else
  if (alive) atomic_or(&memory->alive, 1u);
  rs_group_barrier();
  return memory->alive != 0;
#endif
}

// No candidate behind the next `batch` is nearer than this.
float group_bound(const __local ForwardMemory* memory,
                  const GroupCandidates* c,
                  const int batch,
                  const PacketScene scene) {
  if (c->queued - c->taken > (uint)batch)
    return scene.limits[memory->queue[(c->taken + batch) % RS_GROUP_QUEUE]].x;
  return c->read < c->end ? scene.limits[c->read].x : INFINITY;
}

// Puts `total` rows in the order of their nearest keys, from 0 on: the `waiting` ones, which lie
// from `begin` on, and those of the batch. What no ray hits falls out.
RS_GROUP_INLINE void group_order_rows(__local ForwardMemory* memory,
                                      const GroupCandidates* candidates,
                                      const int lane,
                                      const int begin,
                                      const int waiting,
                                      const int total) {
  __local WaitingRows* w = &memory->waiting;
  // One number after the other: a work-item keeps few of them at a time. Those without a row take
  // part with the last one, which they put nowhere.
  int to[RS_WAITING_EACH];
  uint moved[RS_WAITING_EACH];
#pragma unroll
  for (int n = 0; n < RS_WAITING_EACH; ++n) {
    const int i = group_waiting_row(lane, n, total);
    const float key = group_waiting_key(memory, begin, waiting, i);
    const int others = lane + n * GROUP < total && key < INFINITY ? total : 0;
    int place = others > 0 ? 0 : -1;
    for (int j = 0; j < others; ++j) {
      const float other = group_waiting_key(memory, begin, waiting, j);
      place += other < key || (other == key && j < i);
    }
    to[n] = place;
    moved[n] = i < waiting ? w->candidate[begin + i]
                           : memory->queue[(candidates->taken + i - waiting) % RS_GROUP_QUEUE];
  }
  rs_group_barrier();
#pragma unroll
  for (int n = 0; n < RS_WAITING_EACH; ++n) {
    const int i = group_waiting_row(lane, n, total);
    if (to[n] >= 0) w->candidate[to[n]] = moved[n];
    moved[n] = i < waiting ? as_uint(w->last_key[begin + i]) : memory->found_last[i - waiting];
  }
  rs_group_barrier();
#pragma unroll
  for (int n = 0; n < RS_WAITING_EACH; ++n) {
    const int i = group_waiting_row(lane, n, total);
    if (to[n] >= 0) w->last_key[to[n]] = as_float(moved[n]);
    moved[n] = as_uint(group_waiting_key(memory, begin, waiting, i));
  }
  rs_group_barrier();
#pragma unroll
  for (int n = 0; n < RS_WAITING_EACH; ++n) {
    if (to[n] >= 0) w->first_key[to[n]] = as_float(moved[n]);
  }
  rs_group_barrier();
}

// Settles the open rows of the slots `closing`, which have their places in the stream.
RS_GROUP_INLINE void group_settle_rows(__local OpenRows* rows,
                                       const int lane,
                                       RowSet closing,
                                       const PacketScene scene,
                                       const OwnRows* own,
                                       RowProgress* progress,
                                       PacketState* p,
                                       const HitStream* stream) {
  for (; closing != 0; closing &= closing - 1)
    group_settle(rows, own, rs_first_slot(closing), lane, scene, p, &progress->settled, stream);
}

// Opens the nearest row that waits, which is the r-th: the open ones that lie before it settle,
// with the others it is compared. False where no slot is free.
RS_GROUP_INLINE bool group_open_row(__local ForwardMemory* memory,
                                    const int lane,
                                    const int r,
                                    const PacketScene scene,
                                    const int alive,
                                    OwnRows* own,
                                    RowProgress* progress,
                                    PacketState* p,
                                    HitStream* stream) {
  __local OpenRows* rows = &memory->open;
  __local const WaitingRows* w = &memory->waiting;
  const float first_key = w->first_key[r];
  const uint k = w->candidate[r];
  const uint reference = scene.references[k];
  const PacketHit hit = packet_hit(p, scene, reference, scene.limits[k].y, alive);
  // Compared as integers (keys are not negative), less one where an equal key of a Gaussian with a
  // higher index counts as farther.
  const int order = as_int(hit.key) & 0x7fffffff;
  RowSet closing = 0;
  float before = 1.0f;
  RS_TALLY(p, RS_TALLY_OPENED, 1);
  RS_TALLY(p, RS_TALLY_COMPARED, popcount(progress->open));
  for (RowSet rest = progress->open; rest != 0; rest &= rest - 1) {
    const uint other = rs_first_slot(rest);
    if (rows->last_key[other] < first_key) {
      closing |= RS_SLOT(other);
      continue;
    }
    const bool nearer = order - (reference < rows->reference[other] ? 1 : 0) <
                        as_int(rs_row_get(rows->key, own->key, other, lane));
    if (nearer) {
      const float other_before = rs_row_get(rows->before, own->before, other, lane);
      rs_row_set(rows->before, own->before, other, lane, other_before - other_before * hit.alpha);
    } else {
      before -= before * rs_row_get(rows->alpha, own->alpha, other, lane);
    }
  }
  // (The backward pass counts on a free slot beside all that were open before: group_backward.cl.)
  const RowSet free = ~(progress->open | progress->closed);
  const bool fits = free != 0;
  const uint slot = fits ? rs_first_slot(free) : 0;
  const uint settling = (uint)popcount(closing);
  if (lane == 0 && fits) {
#if KEEP_HITS
    group_push_rows(memory, closing, progress->settled_rows, stream);
#endif
    rows->last_key[slot] = w->last_key[r];
    rows->reference[slot] = reference;
    rows->settled[slot] = progress->settled_rows + settling;
  }
  rs_group_barrier();
  group_settle_rows(rows, lane, fits ? closing : 0, scene, own, progress, p, stream);
  progress->settled_rows += settling;
  progress->open = (progress->open & ~closing) | RS_SLOT(slot);
  progress->closed = closing;
  rs_row_set(rows->key, own->key, slot, lane, as_float(order));
  rs_row_set(rows->alpha, own->alpha, slot, lane, hit.alpha);
  rs_row_set(rows->before, own->before, slot, lane, before * progress->settled);
  return fits;
}

// Traces the rays. False when they need more rows at once than there is room for, or a ray has more
// than max_hits hits: group_passes.h has no such limits. Work-item 0 alone pushes rows into its
// stream; all set them.
RS_GROUP_INLINE bool group_in_rows(__local ForwardMemory* memory,
                                   GroupCandidates* candidates,
                                   const int lane,
                                   const PacketScene scene,
                                   PacketState* p,
                                   HitStream* stream) {
  OwnRows own;
  RowProgress progress = {1.0f, 0, 0, 0};
  int alive = p->valid;
  candidates->read = candidates->begin;
  candidates->queued = candidates->taken = 0;
  int begin = 0, waiting = 0;
  bool fits = true;
  bool goes_on = true;
  while (goes_on && fits) {
    group_fetch(memory, candidates, lane);
    const int queued = (int)(candidates->queued - candidates->taken);
    const int batch = min(min(queued, RS_GROUP_BATCH), WAITING - waiting);
    fits = batch > 0 || queued == 0;
    const bool some_alive = group_test_batch(memory, candidates, lane, batch, scene, alive, p);
    RS_TALLY(p, RS_TALLY_ROUNDS, 1);
    RS_TALLY(p, RS_TALLY_TESTED, batch);
    const float bound = group_bound(memory, candidates, batch, scene);
    goes_on = some_alive && bound < INFINITY;
    const int total = waiting + batch;
    int found = 0, ready = 0;
    for (int i = 0; i < total; ++i) {
      const float key = group_waiting_key(memory, begin, waiting, i);
      found += key < INFINITY;
      ready += key < INFINITY && key <= bound;
    }
    if (!some_alive) ready = 0;
    RS_TALLY(p, RS_TALLY_FOUND, found - waiting);
    RS_TALLY(p, RS_TALLY_ORDERED, total * (1 + (total + GROUP - 1) / GROUP));
    group_order_rows(memory, candidates, lane, begin, waiting, total);
    candidates->taken += batch;
    for (int r = 0; r < ready && fits; ++r)
      fits = group_open_row(memory, lane, r, scene, alive, &own, &progress, p, stream);
    begin = ready;
    waiting = found - ready;
    alive &= RS_MASK(p->T >= scene.min_transmittance);
  }
  RS_TALLY(p, RS_TALLY_BOXES, (candidates->read - candidates->begin + GROUP - 1) / GROUP);
  const RowSet left = fits ? progress.open : 0;
#if KEEP_HITS
  if (lane == 0) group_push_rows(memory, left, progress.settled_rows, stream);
#endif
  rs_group_barrier();
  group_settle_rows(&memory->open, lane, left, scene, &own, &progress, p, stream);
  return rs_group_bits(memory->words, lane, !fits || p->hits > scene.max_hits) == 0;
}

#endif
