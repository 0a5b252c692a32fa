// SPDX-License-Identifier: Apache-2.0
// trace_backward_group: what trace_backward does, with a packet per work-group (group.h) and the
// streams that trace_forward_group kept. The components of a line's gradient are summed over the
// rays through local memory, or by the subgroup; one work-item adds one of them to the sums.
//   PRIVATE_COPIES 1: work-group g of `copies` takes every copies-th tile and adds to its own copy.
//   otherwise:        a work-group per packet of the band.
#ifndef TILE
#define TILE 16
#endif

#include "trace/arguments.h"
// Rows of less than the forward pass keeps: more of them find room in local memory.
#ifndef OPEN_LOCAL
#define OPEN_LOCAL 24
#endif

#include "trace/group.h"
#include "trace/hit_stream.h"
#include "trace/line_gradient.h"

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
    if (!has_number(general, k)) continue;
    const float sum = sub_group_reduce_add(g[k]);
    if (lane == k % GROUP) mine[k / GROUP] = sum;
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

// The alpha of the Gaussian of line v in the packet's rays.
float group_alpha(__global const float* v, const PacketMeeting* m) {
  return v[12] * rs_exp(-0.5f * m->numerator / m->direction2);
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
  if (before >= closed->before) {
    closed->before = before;
    closed->from_here = from_here;
  }
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

// `works`: whether there is a packet at (group_x, group_y); otherwise nothing happens.
RS_GROUP_INLINE void group_backward(__local BackwardMemory* memory,
                                    const int lane,
                                    const bool works,
                                    const BackwardScene scene,
                                    const int group_x,
                                    const int group_y) {
  const uint2 tail = works
                         ? scene.stream_ends[rs_group_number(scene.camera->width, group_x, group_y)]
                         : (uint2)(RS_NO_CHUNK, 0);
  Pixels p;
  load_pixels(&p, scene, group_x + lane % RS_GROUP_WIDTH, group_y + lane / RS_GROUP_WIDTH);
  OwnBackwardRows own;
  ClosedHit closed = {0.0f, 0.0f};
  RowSet open = 0;  // slots that are taken, a bit each
  // Rows are numbered downwards from a number that no window reaches below.
  uint number = 0x80000000u;
  const bool crowded = (tail.y & RS_STREAM_CROWDED) != 0;
  uint chunk = crowded == (CROWDED != 0) ? tail.x : RS_NO_CHUNK;
  uint used = tail.y & ~RS_STREAM_CROWDED;
  while (chunk != RS_NO_CHUNK) {
    const size_t first = (size_t)chunk * CHUNK;
    for (uint n = used - 1; n > 0; --n, --number) {
      RowSet closing = 0;
      for (RowSet rest = open; rest != 0; rest &= rest - 1) {
        if (memory->oldest[rs_first_slot(rest)] > number) closing |= rest & -rest;
      }
      open &= ~closing;
      for (; closing != 0; closing &= closing - 1)
        close_row(memory, &own, lane, rs_first_slot(closing), &p, scene, &closed);
      const uint2 row = scene.pool[first + n];
      const float before = scene.pool_transmittance[(first + n) * GROUP + lane];
      __global const float* v = scene.lines[row.x >> 1].v;
      const PacketMeeting m = rs_meet(v, row.x & 1, 0.0f, p.X, p.Y);
      const float mine = before * group_alpha(v, &m) * rs_projected(&p, v, &m);
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
          rs_row_set(memory->from_here, own.from_here, slot, lane, from_there + mine);
          if (other == before) {
            tied.before = other;
            tied.from_here = from_there;
          }
        }
      }
      if (tied.before > 0.0f) next = tied;
      const uint slot = rs_first_slot(~open);
      open |= RS_SLOT(slot);
      rs_row_set(memory->before, own.before, slot, lane, before);
      rs_row_set(memory->from_here, own.from_here, slot, lane, next.from_here + mine);
      if (lane == 0) {
        memory->reference[slot] = row.x;
        memory->oldest[slot] = number - row.y;
      }
      rs_group_barrier();
    }
    chunk = scene.pool[first].x;
    used = CHUNK;
  }
  for (; open != 0; open &= open - 1)
    close_row(memory, &own, lane, rs_first_slot(open), &p, scene, &closed);
}

RS_GROUP_KERNEL __kernel void trace_backward_group(RS_BACKWARD_ARGUMENTS) {
  __local BackwardMemory memory;
  const RsCamera camera = camera_argument;
  const RsBackward backward = backward_argument;
  const uint tiles_x = backward.tiles_x, tile_row = backward.tile_row;
  const int lane = rs_group_lane();
  BackwardScene scene =
      backward_scene(&camera, &backward, tangents, transmittances, stream_ends, pool,
                     pool_transmittance, lines, image_gradient, depth_gradient, gradients);
#if PRIVATE_COPIES
  // Tiles are numbered over the whole image, so that the sums do not depend on the bands.
  const uint group = get_group_id(0);
  scene.sums.lines += (size_t)group * backward.gaussians * 16;
  const uint groups = backward.copies;
  const uint first = tile_row * tiles_x, end = first + backward.tile_rows * tiles_x;
  for (uint tile = first + (group + groups - first % groups) % groups; tile < end; tile += groups) {
    const bool works = rs_on_face(tiles, face, tile);
    const int x0 = tile % tiles_x * TILE;
    const int y0 = tile / tiles_x * TILE;
    for (int y = y0; y < min(y0 + TILE, camera.height); y += RS_GROUP_HEIGHT) {
      for (int x = x0; x < min(x0 + TILE, camera.width); x += RS_GROUP_WIDTH) {
        group_backward(&memory, lane, works, scene, x, y);
      }
    }
  }
#else
  const int x = (int)get_group_id(0) * RS_GROUP_WIDTH;
  const int y = (int)get_global_id(1) * RS_GROUP_HEIGHT + tile_row * TILE;
  const bool works = x < camera.width && y < camera.height &&
                     rs_on_face(tiles, face, y / TILE * tiles_x + x / TILE);
  group_backward(&memory, lane, works, scene, x, y);
#endif
}
