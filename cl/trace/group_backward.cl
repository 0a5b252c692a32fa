// SPDX-License-Identifier: Apache-2.0
// trace_backward_group: what trace_backward does, with packets that are work-groups (group.h) and
// the streams that trace_forward_group kept. The components of a line's gradient are summed over
// the rays through local memory, or by the subgroup; one work-item adds one of them to the sums.
//   PRIVATE_COPIES 1: work-group g of `copies` takes every copies-th tile and adds to its own copy.
//   otherwise:        a work-group per segment of a stream (stream_segments.cl).
#ifndef TILE
#define TILE 16
#endif

#include "trace/arguments.h"
// Rows of less than the forward pass keeps: more of them find room in local memory.
#ifndef OPEN_LOCAL
#define OPEN_LOCAL 24
#endif

#include "trace/stream_segment.h"

#if (RS_SEGMENT_CHUNKS - 1) * (CHUNK - 1) < OPEN
#error "The last segment of a stream has to be longer than all that is open there"
#endif

// Rows that reach into a segment and one work-item puts in order.
#define RS_REACHING_EACH ((OPEN + GROUP - 1) / GROUP)
// Numbers of a line that are summed at once, and parts in which the rays of a group are, so that
// all work-items have a share.
#define RS_SUM_NUMBERS 8
#define RS_SUM_PARTS (GROUP > RS_SUM_NUMBERS ? GROUP / RS_SUM_NUMBERS : 1)
#define RS_SUM_RAYS (GROUP / RS_SUM_PARTS)
// Numbers that a work-item of a subgroup adds.
#define RS_SUM_EACH ((16 + GROUP - 1) / GROUP)

// What an open row brings, per ray: the transmittance in front, 0 in rays that do not blend it, and
// the sum of T alpha (colour . gradient) over it and all hits behind it. Of two hits of a ray the
// one with more transmittance in front is nearer (of a tie either), and the sum from the nearest
// hit behind a row on is all that is behind it: no row has to be asked for its own share.
typedef struct {
  float before[OPEN_LOCAL][GROUP];
  float from_here[OPEN_LOCAL][GROUP];
#if !SUBGROUP
  float part[RS_SUM_NUMBERS][GROUP + 1];  // one more than rays: columns fall on other banks
  float sum[RS_SUM_PARTS][16];
#endif
  uint reference[OPEN];
  uint oldest[OPEN];  // number of the nearest row that it may change places with
} BackwardMemory;

// The same of the rows beyond OPEN_LOCAL, in private memory.
typedef struct {
  float before[RS_OPEN_OWN];
  float from_here[RS_OPEN_OWN];
} OwnBackwardRows;

// The nearest hit of a ray among the rows that are closed: farther than all that are still to come.
typedef struct {
  float before, from_here;
} ClosedHit;

// Whether lines of a form have number k of a gradient.
bool has_number(const bool general, const int k) {
  return general || k < RS_PROJECTIVE_END || k >= 12;
}

#if SUBGROUP
// The sum of number k over the subgroup, for the work-item that adds it.
RS_GROUP_INLINE void sum_number(const int lane, const int k, const float* g, float* mine) {
  const float sum = sub_group_reduce_add(g[k]);
  if (lane == k % GROUP) mine[k / GROUP] = sum;
}
#endif

// Adds the sums of g over the group to the line of `reference`.
RS_GROUP_INLINE void group_add_line(__local BackwardMemory* memory,
                                    const int lane,
                                    const LineSums* sums,
                                    const uint reference,
                                    const float* g) {
  const bool general = reference & 1;
  const size_t line = (size_t)(reference >> 1) * 16;
#if SUBGROUP
  (void)memory;
  float mine[RS_SUM_EACH];
#pragma unroll
  for (int k = 0; k < 16; ++k) {
    if (has_number(false, k)) sum_number(lane, k, g, mine);
  }
  // Last: of sums behind such a branch PoCL 6.0 loses the first.
  if (general) {
#pragma unroll
    for (int k = RS_PROJECTIVE_END; k < 12; ++k) sum_number(lane, k, g, mine);
  }
#pragma unroll
  for (int i = 0; i < RS_SUM_EACH; ++i) {
    const int k = lane + i * GROUP;
    if (k < 16 && has_number(general, k)) rs_add_sum(sums, line + k, mine[i]);
  }
#else
#pragma unroll
  for (int begin = 0; begin < 16; begin += RS_SUM_NUMBERS) {
#pragma unroll
    for (int k = 0; k < RS_SUM_NUMBERS; ++k) memory->part[k][lane] = g[begin + k];
    rs_group_barrier();
    for (int i = lane; i < RS_SUM_NUMBERS * RS_SUM_PARTS; i += GROUP) {
      const int k = i % RS_SUM_NUMBERS, first = i / RS_SUM_NUMBERS * RS_SUM_RAYS;
      float sum = 0.0f;
      for (int j = 0; j < RS_SUM_RAYS; ++j) sum += memory->part[k][first + j];
      memory->sum[i / RS_SUM_NUMBERS][begin + k] = sum;
    }
    rs_group_barrier();
  }
  for (int k = lane; k < 16; k += GROUP) {
    if (!has_number(general, k)) continue;
    float sum = memory->sum[0][k];
    for (int j = 1; j < RS_SUM_PARTS; ++j) sum += memory->sum[j][k];
    rs_add_sum(sums, line + k, sum);
  }
#endif
}

// A row is closed: whatever is still to come lies in front of it.
void close_hit(const float before, const float from_here, ClosedHit* closed) {
  if (before >= closed->before) {
    closed->before = before;
    closed->from_here = from_here;
  }
}

// The row of the slot has met all rows that it may change places with: its gradient is complete.
RS_GROUP_INLINE void close_row(__local BackwardMemory* memory,
                               const OwnBackwardRows* own,
                               const int lane,
                               const uint slot,
                               const Pixels* p,
                               const BackwardScene scene,
                               ClosedHit* closed) {
  const uint reference = memory->reference[slot];
  __global const float* v = scene.lines[reference >> 1].v;
  const PacketMeeting m = rs_meet(v, reference & 1, 0.0f, p->X, p->Y);
  const float alpha = group_alpha(v, &m);
  const float before = rs_row_get(memory->before, own->before, slot, lane);
  const float from_here = rs_row_get(memory->from_here, own->from_here, slot, lane);
  close_hit(before, from_here, closed);
  const float projected = rs_projected(p, v, &m);
  // Only the last hit of a ray can be opaque, and only the background is behind that.
  const float behind =
      before <= p->T_last
          ? before * p->sky
          : (from_here - before * alpha * projected + p->T * p->sky) * (1.0f / (1.0f - alpha));
  const float g_alpha = before > 0.0f ? before * projected - behind : 0.0f;
  float g[16];
  line_gradient(p, reference & 1, v, g_alpha, alpha, before * alpha, g);
  group_add_line(memory, lane, &scene.sums, reference, g);
}

// Rows that a group still has to read: first those of segments behind that its own may change
// places with, then its own, from the last one on.
typedef struct {
  uint reaching;  // of the first kind
  uint chunk, n;  // of the second: chunk, and row in it
  uint rows;      // of the second, or more where a stream ends by itself
  uint number;
} RowsToRead;

// Puts the rows that reach into a segment in the order of its stream, the last one first: they were
// written in any order, and sums must not depend on it.
RS_GROUP_INLINE void order_reaching(__global RsReachingRow* rows,
                                    const uint count,
                                    const int lane) {
  RsReachingRow own[RS_REACHING_EACH];
  uint place[RS_REACHING_EACH];
#pragma unroll
  for (int k = 0; k < RS_REACHING_EACH; ++k) {
    place[k] = lane + k * GROUP;
    if (place[k] >= count) continue;
    own[k] = rows[place[k]];
    place[k] = 0;
    for (uint j = 0; j < count; ++j) place[k] += rows[j].number > own[k].number ? 1 : 0;
  }
  RS_GROUP_BARRIER(CLK_GLOBAL_MEM_FENCE);
#pragma unroll
  for (int k = 0; k < RS_REACHING_EACH; ++k) {
    if (place[k] < count) rows[place[k]] = own[k];
  }
  RS_GROUP_BARRIER(CLK_GLOBAL_MEM_FENCE);
}

// Goes on to the row in front.
void pass_row(RowsToRead* rows, __global const uint2* pool) {
  --rows->number;
  --rows->rows;
  if (--rows->n == 0) {
    rows->chunk = pool[(size_t)rows->chunk * CHUNK].x;
    rows->n = CHUNK - 1;
  }
}

// The open rows hear of those in front of the segment that may lie behind them: `rows` begin there.
RS_GROUP_INLINE void hear_front(__local BackwardMemory* memory,
                                OwnBackwardRows* own,
                                const int lane,
                                const RowSet open,
                                const BackwardScene scene,
                                const Pixels* p,
                                RowsToRead rows) {
  uint first = RS_LAST_NUMBER;
  for (RowSet rest = open; rest != 0; rest &= rest - 1)
    first = min(first, memory->oldest[rs_first_slot(rest)]);
  while (rows.number >= first && rows.chunk != RS_NO_CHUNK) {
    const StreamHit hit = stream_hit(scene, p, rows.chunk * CHUNK + rows.n, lane);
    for (RowSet rest = open; rest != 0; rest &= rest - 1) {
      const uint slot = rs_first_slot(rest);
      if (memory->oldest[slot] > rows.number ||
          rs_row_get(memory->before, own->before, slot, lane) < hit.before)
        continue;
      const float from_there = rs_row_get(memory->from_here, own->from_here, slot, lane);
      rs_row_set(memory->from_here, own->from_here, slot, lane, from_there + hit.share);
    }
    pass_row(&rows, scene.pool);
  }
}

// `behind`: the ray's sum over all rows behind the segment, without those that reach into it.
RS_GROUP_INLINE void group_backward(__local BackwardMemory* memory,
                                    const int lane,
                                    const BackwardScene scene,
                                    const Pixels* p,
                                    RowsToRead rows,
                                    __global const RsReachingRow* reaching,
                                    const float behind) {
  OwnBackwardRows own;
  ClosedHit closed = {0.0f, behind};
  RowSet open = 0;    // slots that are taken, a bit each
  RowSet guests = 0;  // those whose gradients are for the segment behind
  while (rows.reaching > 0 || (rows.rows > 0 && rows.chunk != RS_NO_CHUNK)) {
    const bool guest = rows.reaching > 0;
    const uint number = guest ? reaching->number : rows.number;
    RowSet closing = 0;
    for (RowSet rest = open; rest != 0; rest &= rest - 1) {
      if (memory->oldest[rs_first_slot(rest)] > number) closing |= rest & -rest;
    }
    const RowSet left = closing & guests;
    for (RowSet rest = left; rest != 0; rest &= rest - 1) {
      const uint slot = rs_first_slot(rest);
      close_hit(rs_row_get(memory->before, own.before, slot, lane),
                rs_row_get(memory->from_here, own.from_here, slot, lane), &closed);
    }
    open &= ~closing;
    closing &= ~guests;
    guests &= open;
    for (; closing != 0; closing &= closing - 1)
      close_row(memory, &own, lane, rs_first_slot(closing), p, scene, &closed);
    const size_t row = guest ? reaching->row : rows.chunk * CHUNK + rows.n;
    const StreamHit hit = stream_hit(scene, p, row, lane);
    const float before = hit.before;
    ClosedHit next = closed;  // the nearest behind this one
    // Hits too faint to change the transmittance tie with the one behind them. Whatever ties has
    // one sum, that of all of them, so that it does not matter which is taken for the nearest.
    ClosedHit tied = {0.0f, 0.0f};
    for (RowSet rest = open; rest != 0; rest &= rest - 1) {
      const uint slot = rs_first_slot(rest);
      const float other = rs_row_get(memory->before, own.before, slot, lane);
      const bool farther = other < before;
      if (farther ? other <= next.before : before <= 0.0f) continue;
      const float from_there = rs_row_get(memory->from_here, own.from_here, slot, lane);
      if (farther) {
        next.before = other;
        next.from_here = from_there;
      } else {
        rs_row_set(memory->from_here, own.from_here, slot, lane, from_there + hit.share);
        if (other == before) {
          tied.before = other;
          tied.from_here = from_there;
        }
      }
    }
    if (tied.before > 0.0f) next = tied;
    // Others may still read of what a guest leaves. There is room: where the row of this number was
    // settled the forward pass had another slot free (group_open_row), but at the end of a stream,
    // whose segment is longer than all that is open there.
    const uint slot = rs_first_slot(~(open | left));
    open |= RS_SLOT(slot);
    guests |= guest ? RS_SLOT(slot) : 0;
    rs_row_set(memory->before, own.before, slot, lane, before);
    rs_row_set(memory->from_here, own.from_here, slot, lane, next.from_here + hit.share);
    if (lane == 0) {
      memory->reference[slot] = hit.row.x;
      memory->oldest[slot] = number - hit.row.y;
    }
    rs_group_barrier();
    if (guest) {
      --rows.reaching;
      ++reaching;
    } else {
      pass_row(&rows, scene.pool);
    }
  }
  open &= ~guests;
  hear_front(memory, &own, lane, open, scene, p, rows);
  for (; open != 0; open &= open - 1)
    close_row(memory, &own, lane, rs_first_slot(open), p, scene, &closed);
}

#if PRIVATE_COPIES
// The whole stream of a packet. `works`: whether there is a packet; otherwise nothing happens.
RS_GROUP_INLINE void packet_backward(__local BackwardMemory* memory,
                                     const int lane,
                                     const bool works,
                                     const BackwardScene scene,
                                     const int2 corner) {
  const uint2 tail =
      works ? scene.stream_ends[rs_group_number(scene.camera->width, corner.x, corner.y)]
            : (uint2)(RS_NO_CHUNK, 0);
  const bool mine = ((tail.y & RS_STREAM_CROWDED) != 0) == (CROWDED != 0);
  const RowsToRead rows = {0, mine ? tail.x : RS_NO_CHUNK, (tail.y & ~RS_STREAM_CROWDED) - 1,
                           0xffffffffu, RS_LAST_NUMBER};
  Pixels p;
  load_group_pixels(&p, scene, corner, lane);
  group_backward(memory, lane, scene, &p, rows, 0, 0.0f);
}
#else
// The segment of this group, if there is one and it is for this launch.
RS_GROUP_INLINE void segment_backward(__local BackwardMemory* memory,
                                      const int lane,
                                      const BackwardScene scene,
                                      RS_SEGMENT_ARGUMENTS(const)) {
  RsStreamSegment segment = {0, RS_NO_CHUNK, 0, 0, 0, RS_NO_SEGMENT, RS_NO_SEGMENT, RS_NO_SEGMENT};
  const uint place = segment_of_group(get_global_id(0) / GROUP, counts[RS_SEGMENT_COUNT], room);
  if (place != RS_NO_SEGMENT) segment = segments[place];
  const bool mine =
      segment.chunk != RS_NO_CHUNK && ((segment.used & RS_STREAM_CROWDED) != 0) == (CROWDED != 0);
  Pixels p;
  load_group_pixels(&p, scene, packet_corner(scene.camera->width, segment.packet), lane);
  RowsToRead rows = {0, mine ? segment.chunk : RS_NO_CHUNK, (segment.used & ~RS_STREAM_CROWDED) - 1,
                     segment.rows, segment.number};
  const bool cut = mine && segment.slot != RS_NO_SEGMENT;
  float behind = 0.0f;
  if (cut) {
    rows.reaching = min(counts[RS_SEGMENT_COUNTS + segment.slot], (uint)OPEN);
    reaching += (size_t)segment.slot * RS_SEGMENT_REACHING;
    for (uint next = segment.behind; next != RS_NO_SEGMENT; next = segments[next].behind)
      behind += segment_sums[(size_t)segments[next].slot * GROUP + lane];
  }
  order_reaching(reaching, rows.reaching, lane);
  for (uint i = 0; i < rows.reaching; ++i)
    behind -= stream_hit(scene, &p, reaching[i].row, lane).share;
  group_backward(memory, lane, scene, &p, rows, reaching, behind);
}
#endif

#if PRIVATE_COPIES
RS_GROUP_KERNEL __kernel void trace_backward_group(RS_BACKWARD_ARGUMENTS) {
#else
RS_GROUP_KERNEL __kernel void trace_backward_group(RS_BACKWARD_ARGUMENTS,
                                                   RS_SEGMENT_ARGUMENTS(const)) {
#endif
  __local BackwardMemory memory;
  const RsCamera camera = camera_argument;
  const RsBackward backward = backward_argument;
  const int lane = rs_group_lane();
  BackwardScene scene =
      backward_scene(&camera, &backward, tangents, transmittances, stream_ends, pool,
                     pool_transmittance, lines, image_gradient, depth_gradient, gradients);
#if PRIVATE_COPIES
  // Tiles are numbered over the whole image, so that the sums do not depend on the bands.
  const uint group = get_group_id(0);
  scene.sums.lines += (size_t)group * backward.gaussians * 16;
  const uint groups = backward.copies, tiles_x = backward.tiles_x, tile_row = backward.tile_row;
  const uint first = tile_row * tiles_x, end = first + backward.tile_rows * tiles_x;
  for (uint tile = first + (group + groups - first % groups) % groups; tile < end; tile += groups) {
    const bool works = rs_on_face(tiles, face, tile);
    const int x0 = tile % tiles_x * TILE;
    const int y0 = tile / tiles_x * TILE;
    for (int y = y0; y < min(y0 + TILE, camera.height); y += RS_GROUP_HEIGHT) {
      for (int x = x0; x < min(x0 + TILE, camera.width); x += RS_GROUP_WIDTH) {
        packet_backward(&memory, lane, works, scene, (int2)(x, y));
      }
    }
  }
#else
  (void)tiles;
  (void)face;
  segment_backward(&memory, lane, scene, room, segments, counts, segment_sums, reaching);
#endif
}
