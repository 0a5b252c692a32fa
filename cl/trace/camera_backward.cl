// SPDX-License-Identifier: Apache-2.0
// trace_backward: gradient of the loss for the line of every Gaussian of the view, from the hit
// streams that trace_forward kept. A packet walks its stream last to first. The gradient of a hit's
// alpha needs its colour and what lies behind it: the sum of T alpha colour over farther hits,
// which is gathered pairwise among rows whose windows overlap (lanes may meet them in either order)
// and in one sum beyond. Nothing is subtracted, and nothing divided where alpha = 1: only the last
// hit of a ray can be opaque. The components of a Gaussian's line are summed over the rays of
// the packet and added to memory once.
//   PRIVATE_COPIES 1: work-item g of `copies` takes every copies-th tile and adds to its own copy
//                     of the gradient lines: no atomics, the same sum every time.
//                     global size: groups
//   EXACT_SUMS 1:     one long integer per component (exact_sum.h): the same sum whatever the order
//                     of the packets, with integer atomics only.
//                     global size: packets of the band
//   otherwise:        one copy of shared floats (float_add.h).
//                     global size: packets of the band
// With DEPTH_GRADIENT depth_gradient is that of the sum of T alpha t of every pixel, t being the
// depth of a hit; else it is not read.
// Components of a line's gradient follow the line; slot 2 sums the per-ray lengths of the screen
// gradient, the densification signal of AbsGS (Ye et al. 2024), in place of that of m_z, which only
// depths have a gradient of: it is in slot 9.
#include "parallel/prefetch.h"
#include "trace/arguments.h"
#include "trace/hit_stream.h"
#include "trace/line_gradient.h"
#include "trace/packet.h"

#ifndef TILE
#define TILE 32
#endif
// Lane i of the result is the sum of v[i] over its lanes. With 16 lanes, pairs of vectors are
// folded into one by adding halves, then quarters, and so on: 15 additions for all sums. Inlined,
// so that the vectors stay in registers.
__attribute__((always_inline)) float16 sum_lanes(const fv* v) {
#if PACKET == 16
#define RS_HALVES(x, y) ((float16)((x).lo, (y).lo) + (float16)((x).hi, (y).hi))
#define RS_QUARTERS(x, y)                                  \
  ((float16)((x).s0123, (y).s0123, (x).s89ab, (y).s89ab) + \
   (float16)((x).s4567, (y).s4567, (x).scdef, (y).scdef))
#define RS_PAIRS(x, y)                                                                 \
  ((float16)((x).s01, (y).s01, (x).s45, (y).s45, (x).s89, (y).s89, (x).scd, (y).scd) + \
   (float16)((x).s23, (y).s23, (x).s67, (y).s67, (x).sab, (y).sab, (x).sef, (y).sef))
  const float16 a0 = RS_HALVES(v[0], v[8]), a1 = RS_HALVES(v[1], v[9]);
  const float16 a2 = RS_HALVES(v[2], v[10]), a3 = RS_HALVES(v[3], v[11]);
  const float16 a4 = RS_HALVES(v[4], v[12]), a5 = RS_HALVES(v[5], v[13]);
  const float16 a6 = RS_HALVES(v[6], v[14]), a7 = RS_HALVES(v[7], v[15]);
  const float16 b0 = RS_QUARTERS(a0, a4), b1 = RS_QUARTERS(a1, a5);
  const float16 b2 = RS_QUARTERS(a2, a6), b3 = RS_QUARTERS(a3, a7);
  const float16 x = RS_PAIRS(b0, b2), y = RS_PAIRS(b1, b3);
  return (float16)(x.s0, y.s0, x.s2, y.s2, x.s4, y.s4, x.s6, y.s6, x.s8, y.s8, x.sa, y.sa, x.sc,
                   y.sc, x.se, y.se) +
         (float16)(x.s1, y.s1, x.s3, y.s3, x.s5, y.s5, x.s7, y.s7, x.s9, y.s9, x.sb, y.sb, x.sd,
                   y.sd, x.sf, y.sf);
#else
  return (float16)(rs_lane_sum(v[0]), rs_lane_sum(v[1]), rs_lane_sum(v[2]), rs_lane_sum(v[3]),
                   rs_lane_sum(v[4]), rs_lane_sum(v[5]), rs_lane_sum(v[6]), rs_lane_sum(v[7]),
                   rs_lane_sum(v[8]), rs_lane_sum(v[9]), rs_lane_sum(v[10]), rs_lane_sum(v[11]),
                   rs_lane_sum(v[12]), rs_lane_sum(v[13]), rs_lane_sum(v[14]), rs_lane_sum(v[15]));
#endif
}

// Rows whose place among the others is still open, in order of walking: slots head .. head + size -
// 1 of a ring. behind sums T alpha (colour . gradient) over the hits known to be farther.
typedef struct {
  uint reference[WINDOW];
  uint oldest[WINDOW];  // number of the nearest row that it may change places with
  fv alpha[WINDOW];
  fv before[WINDOW];     // transmittance in front, 0 in lanes that do not blend it
  fv projected[WINDOW];  // colour . gradient
  fv blended[WINDOW];    // T alpha (colour . gradient)
  fv behind[WINDOW];
  uint head, size;
} StreamWindow;

// Sums one Gaussian's gradient line over the rays of the packet and adds it to memory.
void add_gradient(const Pixels* p,
                  const uint reference,
                  const fv g_alpha,
                  const fv alpha,
                  const fv weight,
                  __global const RsLine* restrict lines,
                  const LineSums* sums) {
  fv g[16];
  line_gradient(p, reference & 1, lines[reference >> 1].v, g_alpha, alpha, weight, g);
  const float16 sum = sum_lanes(g);
#if PRIVATE_COPIES
  rs_add_line(sums, reference >> 1, sum);
#else
  rs_add_numbers(sums, reference >> 1, sum, 0, RS_PROJECTIVE_END);
  if (reference & 1) rs_add_numbers(sums, reference >> 1, sum, RS_PROJECTIVE_END, 12);
  rs_add_numbers(sums, reference >> 1, sum, 12, 16);
#endif
}

// The oldest open row has met all rows that it may change places with: its gradient is complete.
// Returns its T alpha (colour . gradient), which lies behind everything still to come.
fv close_row(StreamWindow* rows,
             const Pixels* p,
             __global const RsLine* restrict lines,
             const LineSums* sums) {
  const uint slot = rows->head;
  rows->head = (rows->head + 1) % WINDOW;
  --rows->size;
  const fv alpha = rows->alpha[slot];
  const fv before = rows->before[slot];
  const fv weight = before * alpha;
  // Only the last hit of a ray can be opaque, and only the background is behind that.
  const fv passed = 1.0f / (1.0f - alpha);
  const fv behind = select((rows->behind[slot] + p->T * p->sky) * passed, before * p->sky,
                           RS_MASK(before <= p->T_last));
  const iv mine = RS_MASK(before > 0.0f);
  const fv g_alpha = select((fv)(0.0f), before * rows->projected[slot] - behind, mine);
  add_gradient(p, rows->reference[slot], g_alpha, alpha, weight, lines, sums);
  return rows->blended[slot];
}

// The chunks of a stream lie anywhere in the pool: the next is fetched while one is worked on.
void fetch_chunk(const uint chunk,
                 __global const uint2* restrict pool,
                 __global const float* restrict pool_transmittance) {
  const size_t first = (size_t)chunk * CHUNK;
  (void)first;
  (void)pool;
  (void)pool_transmittance;
  for (uint n = 0; n < CHUNK; n += 8) RS_PREFETCH_READ(pool + first + n);
  for (uint n = 1; n < CHUNK; ++n) RS_PREFETCH_READ(pool_transmittance + (first + n) * PACKET);
}

// Inlined: else its argument would lie in memory, which is private to a ray on GPUs.
__attribute__((always_inline)) void packet_backward(const BackwardScene scene,
                                                    const int px,
                                                    const int py) {
  const uint packets_x = (scene.camera->width + PACKET_WIDTH - 1) / PACKET_WIDTH;
  const uint2 tail = scene.stream_ends[(py / PACKET_HEIGHT) * packets_x + px / PACKET_WIDTH];
  if (tail.x == RS_NO_CHUNK) return;
  Pixels p;
  load_pixels(&p, scene, px, py);
  const LineSums sums = scene.sums;
  StreamWindow rows;
  rows.head = rows.size = 0;
  fv behind = (fv)(0.0f);  // of closed rows: farther than all that are open or still to come
  // Rows are numbered downwards from a number that no window reaches below.
  uint number = 0x80000000u;
  uint chunk = tail.x;
  uint used = tail.y;
  while (chunk != RS_NO_CHUNK) {
    const size_t first = (size_t)chunk * CHUNK;
    const uint next = scene.pool[first].x;
    if (next != RS_NO_CHUNK) fetch_chunk(next, scene.pool, scene.pool_transmittance);
    for (uint n = used - 1; n > 0; --n) {
      const uint gaussian = scene.pool[first + n].x >> 1;
      RS_PREFETCH_READ(scene.lines + gaussian);
      rs_fetch_line(&sums, gaussian);
    }
    for (uint n = used - 1; n > 0; --n, --number) {
      while (rows.size > 0 && rows.oldest[rows.head] > number) {
        behind += close_row(&rows, &p, scene.lines, &sums);
      }
      const fv before = rs_load(scene.pool_transmittance + (first + n) * PACKET);
      if (!rs_any(RS_MASK(before > 0.0f))) continue;
      const uint2 row = scene.pool[first + n];
      __global const float* v = scene.lines[row.x >> 1].v;
      const PacketMeeting m = rs_meet(v, row.x & 1, 0.0f, p.X, p.Y);
      const fv alpha = v[12] * rs_exp(-0.5f * m.numerator / m.direction2);
      const fv projected = rs_projected(&p, v, &m);
      const fv mine = before * alpha * projected;
      fv farther = behind;
      const uint open_end = rows.head + rows.size;
      for (uint i = rows.head; i < open_end; ++i) {
        const uint slot = i % WINDOW;
        const iv is_behind = RS_MASK(rows.before[slot] < before);
        farther += select((fv)(0.0f), rows.blended[slot], is_behind);
        rows.behind[slot] += select(mine, (fv)(0.0f), is_behind);
      }
      const uint slot = (rows.head + rows.size++) % WINDOW;
      rows.reference[slot] = row.x;
      rows.oldest[slot] = number - row.y;
      rows.alpha[slot] = alpha;
      rows.before[slot] = before;
      rows.projected[slot] = projected;
      rows.blended[slot] = mine;
      rows.behind[slot] = farther;
    }
    chunk = next;
    used = CHUNK;
  }
  while (rows.size > 0) close_row(&rows, &p, scene.lines, &sums);
}

__kernel void trace_backward(RS_BACKWARD_ARGUMENTS) {
  const RsCamera camera = camera_argument;
  const RsBackward backward = backward_argument;
  const uint tiles_x = backward.tiles_x, tile_row = backward.tile_row;
  BackwardScene scene =
      backward_scene(&camera, &backward, tangents, transmittances, stream_ends, pool,
                     pool_transmittance, lines, image_gradient, depth_gradient, gradients);
#if PRIVATE_COPIES
  // Tiles are numbered over the whole image, so that the sums do not depend on the bands.
  const uint group = get_global_id(0);
  scene.sums.lines += (size_t)group * backward.gaussians * 16;
  const uint groups = backward.copies;
  const uint first = tile_row * tiles_x, end = first + backward.tile_rows * tiles_x;
  for (uint tile = first + (group + groups - first % groups) % groups; tile < end; tile += groups) {
    if (!rs_on_face(tiles, face, tile)) continue;
    const int x0 = tile % tiles_x * TILE;
    const int y0 = tile / tiles_x * TILE;
    for (int y = y0; y < min(y0 + TILE, camera.height); y += PACKET_HEIGHT) {
      for (int x = x0; x < min(x0 + TILE, camera.width); x += PACKET_WIDTH) {
        packet_backward(scene, x, y);
      }
    }
  }
#else
  const int x = get_global_id(0) * PACKET_WIDTH;
  const int y = get_global_id(1) * PACKET_HEIGHT + tile_row * TILE;
  if (x >= camera.width || y >= camera.height) return;
  if (!rs_on_face(tiles, face, y / TILE * tiles_x + x / TILE)) return;
  packet_backward(scene, x, y);
#endif
}
