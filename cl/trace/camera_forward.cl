// SPDX-License-Identifier: Apache-2.0
// trace_forward: colour and alpha of every pixel, exactly in depth order per ray. One work-item
// traces BLOCK x BLOCK packets of PACKET rays (packet.h), one after the other; the packets of a
// tile share its candidate list, sorted by a lower bound of the depth: what lies before the next
// candidate's bound can be blended.
//   global size: the blocks of whole tiles in x and y from the window's first tile on; any local
//   size
// With LENS a launch traces the tiles of one face (lens_tiles.cl) and leaves the others.
// Cost follows the candidates of the tile that meet the packets. Rows of Gaussians are blended
// without sorting (packet_rows.h); packets beyond its limits start again with sorted lists
// (packet_sorted.h), which have none.
#ifndef TILE
#define TILE 32
#endif
#ifndef KEEP_HITS
#define KEEP_HITS 0
#endif

#include "parallel/counter.h"
#include "trace/arguments.h"
#include "trace/candidates.h"
#include "trace/hit_stream.h"
#include "trace/packet_rows.h"
#include "trace/packet_sorted.h"
#include "trace/packet_state.h"

#ifndef STRETCHES
#define STRETCHES 1
#endif

// Work-items of a tile.
#define ACROSS (TILE / (BLOCK * PACKET_WIDTH))
#define DOWN (TILE / (BLOCK * PACKET_HEIGHT))

// Column and row of the work-item's tile in the window. Tiles that are launched one after the other
// come from STRETCHES stretches of the picture in turn: a thread that is given many at once gets
// some of what is much work and some of what is little.
uint2 tile_in_turn(const uint columns) {
  const uint column = get_global_id(0) / ACROSS, row = get_global_id(1) / DOWN;
#if STRETCHES > 1
  const uint first_row = get_global_offset(1) / DOWN;
  const uint tiles = columns * (uint)(get_global_size(1) / DOWN);
  const uint number = (row - first_row) * columns + column;
  const uint stretch = number % STRETCHES;
  const uint tile =
      stretch * (tiles / STRETCHES) + min(stretch, tiles % STRETCHES) + number / STRETCHES;
  return (uint2)(tile % columns, first_row + tile / columns);
#else
  return (uint2)(column, row);
#endif
}

// counters: chunks wanted, rays that stopped at max_hits, hits (two words).
__kernel void trace_forward(RS_LIST_ARGUMENTS,
                            RS_VIEW_ARGUMENTS,
                            const RsForward forward_argument,
                            RS_STREAM_ARGUMENTS(),
                            __global float* restrict image,
                            __global float* restrict depth_image,
                            volatile __global uint* restrict counters) {
  const RsCamera camera = camera_argument;
  const RsForward forward = forward_argument;
  const PacketScene scene = {lines, references, limits, forward.min_transmittance,
                             forward.max_hits};
  const float4 background =
      (float4)(forward.background[0], forward.background[1], forward.background[2], 0.0f);
  const uint2 at = tile_in_turn(forward.window[2]);
  const int column = at.x, row = at.y;
  if (column >= forward.window[2] || row >= forward.window[3]) return;
  const int block_x =
      (column + forward.window[0]) * TILE + get_global_id(0) % ACROSS * (BLOCK * PACKET_WIDTH);
  const int block_y =
      (row + forward.window[1]) * TILE + get_global_id(1) % DOWN * (BLOCK * PACKET_HEIGHT);
  if (block_x >= camera.width || block_y >= camera.height) return;
  const uint tile = row * forward.window[2] + column;
  const uint picture_tiles_x = (camera.width + TILE - 1) / TILE;
  if (!rs_on_face(tiles, face,
                  (row + forward.window[1]) * picture_tiles_x + column + forward.window[0]))
    return;

  BlockCandidates block;
#if COUNT_WORK
  tally_clear(block.tally);
#endif
  block_candidates_init(&block, boxes, stride, offsets[tile], offsets[tile + 1]);
  for (int q = 0; q < RS_BLOCK_PACKETS; ++q) {
    const int px = block_x + q % BLOCK * PACKET_WIDTH;
    const int py = block_y + q / BLOCK * PACKET_HEIGHT;
#if LENS
    const PacketRays rays = rs_packet_rays(&camera, tangents, px, py);
    block.x0[q] = rs_lane_min(select((fv)(INFINITY), rays.X, rays.valid));
    block.x1[q] = rs_lane_max(select((fv)(-INFINITY), rays.X, rays.valid));
    block.y0[q] = rs_lane_min(select((fv)(INFINITY), rays.Y, rays.valid));
    block.y1[q] = rs_lane_max(select((fv)(-INFINITY), rays.Y, rays.valid));
#else
    block.x0[q] = (px + 0.5f - camera.cx) / camera.fx;
    block.x1[q] = (px + PACKET_WIDTH - 0.5f - camera.cx) / camera.fx;
    block.y0[q] = (py + 0.5f - camera.cy) / camera.fy;
    block.y1[q] = (py + PACKET_HEIGHT - 0.5f - camera.cy) / camera.fy;
#endif
  }
  HitStream stream;
  stream.pool = pool;
  stream.transmittance = pool_transmittance;
  stream.capacity = forward.pool_capacity;
  stream.cursor = counters;
  const int width = camera.width, height = camera.height;
  uint hits = 0, capped_rays = 0;
  for (int q = 0; q < RS_BLOCK_PACKETS; ++q) {
    const int px = block_x + q % BLOCK * PACKET_WIDTH;
    const int py = block_y + q / BLOCK * PACKET_HEIGHT;
    if (px >= width || py >= height) continue;
    Candidates candidates = {&block, q, 0, block.end};
    PacketState p;
#if COUNT_WORK
    tally_clear(p.tally);
    tally_clear(stream.tally);
#endif
    const PacketRays rays = rs_packet_rays(&camera, tangents, px, py);
    p.X = rays.X;
    p.Y = rays.Y;
    p.valid = rays.valid;
    packet_clear(&p);
    stream_restart(&stream);
    iv capped = (iv)(0);
    if (!trace_in_rows(&candidates, scene, &p, &stream)) {
      packet_clear(&p);
      stream_restart(&stream);
      capped = trace_sorted(&candidates, scene, &p, &stream);
    }

    packet_store(&p, image, depth_image, transmittances, width, height, px, py, background);
#if KEEP_HITS
    const uint packets_x = (width + PACKET_WIDTH - 1) / PACKET_WIDTH;
    stream_ends[(py / PACKET_HEIGHT) * packets_x + px / PACKET_WIDTH] =
        (uint2)(stream.chunk, stream.used);
#else
    (void)stream_ends;
#endif
#if COUNT_WORK
    tally_add(p.tally, counters);
    tally_add(stream.tally, counters);
#endif
    capped_rays += popcount(rs_lane_bits(capped));
    hits += (uint)rs_lane_sum(rs_to_float(p.hits));
  }
#if COUNT_WORK
  tally_add(block.tally, counters);
#endif
  if (capped_rays != 0) atomic_add(counters + 1, capped_rays);
  rs_count(counters + 2, hits);
}
