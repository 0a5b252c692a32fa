// SPDX-License-Identifier: Apache-2.0
// trace_forward_group: what trace_forward does, with a packet per work-group (group.h).
//   global size: GROUP times the packets in x, the packets in y, from the window's first tile on
// What is beyond the limits of group_rows.h waits for a launch with CROWDED, and beyond that takes
// passes (group_passes.h).
#ifndef TILE
#define TILE 16
#endif
#ifndef KEEP_HITS
#define KEEP_HITS 0
#endif

#include "parallel/counter.h"
#include "trace/arguments.h"
#include "trace/group.h"
#include "trace/group_passes.h"
#include "trace/group_rows.h"

#if LENS
// Outermost rays of the packet.
void outermost_rays(__local ForwardMemory* memory,
                    const int lane,
                    const PacketRays* rays,
                    GroupCandidates* c) {
#if SUBGROUP
  (void)memory;
  (void)lane;
  c->x0 = sub_group_reduce_min(rays->valid ? rays->X : INFINITY);
  c->x1 = sub_group_reduce_max(rays->valid ? rays->X : -INFINITY);
  c->y0 = sub_group_reduce_min(rays->valid ? rays->Y : INFINITY);
  c->y1 = sub_group_reduce_max(rays->valid ? rays->Y : -INFINITY);
#else
  __local float* X = memory->open.key[0];
  __local float* Y = memory->open.alpha[0];
  X[lane] = rays->valid ? rays->X : INFINITY;
  Y[lane] = rays->valid ? rays->Y : INFINITY;
  rs_group_barrier();
  c->x0 = c->y0 = INFINITY;
  c->x1 = c->y1 = -INFINITY;
  for (int i = 0; i < GROUP; ++i) {
    if (!(X[i] < INFINITY)) continue;
    c->x0 = fmin(c->x0, X[i]);
    c->x1 = fmax(c->x1, X[i]);
    c->y0 = fmin(c->y0, Y[i]);
    c->y1 = fmax(c->y1, Y[i]);
  }
  rs_group_barrier();
#endif
}
#endif

// Stands for the opacity of pixels that are left to the launch with CROWDED.
#define RS_LEFT -1.0f

// counters: chunks wanted, rays that stopped at max_hits, hits (two words).
RS_GROUP_KERNEL __kernel void trace_forward_group(RS_LIST_ARGUMENTS,
                                                  RS_VIEW_ARGUMENTS,
                                                  const RsForward forward_argument,
                                                  RS_STREAM_ARGUMENTS(),
                                                  __global float* restrict image,
                                                  __global float* restrict depth_image,
                                                  volatile __global uint* restrict counters) {
  __local ForwardMemory memory;
  const RsCamera camera = camera_argument;
  const RsForward forward = forward_argument;
  const PacketScene scene = {lines, references, limits, forward.min_transmittance,
                             forward.max_hits};
  const float4 background =
      (float4)(forward.background[0], forward.background[1], forward.background[2], 0.0f);
  const int lane = rs_group_lane();
  const int window_x = (int)get_group_id(0) * RS_GROUP_WIDTH;
  const int window_y = (int)get_global_id(1) * RS_GROUP_HEIGHT;
  const int group_x = window_x + forward.window[0] * TILE;
  const int group_y = window_y + forward.window[1] * TILE;
  const int column = window_x / TILE, row = window_y / TILE;
  const uint picture_tiles_x = (camera.width + TILE - 1) / TILE;
  const uint tile = row * forward.window[2] + column;
  __global float* opacities = image + 3 * (size_t)camera.width * camera.height;
  bool works = column < forward.window[2] && row < forward.window[3] && group_x < camera.width &&
               group_y < camera.height &&
               rs_on_face(tiles, face,
                          (row + forward.window[1]) * picture_tiles_x + column + forward.window[0]);
#if CROWDED
  works = works && opacities[(size_t)group_y * camera.width + group_x] == RS_LEFT;
  RS_GROUP_BARRIER(CLK_GLOBAL_MEM_FENCE);  // work-item 0 writes there at the end
#endif

  const int px = group_x + lane % RS_GROUP_WIDTH;
  const int py = group_y + lane / RS_GROUP_WIDTH;
  PacketState p;
  const PacketRays rays = rs_packet_rays(&camera, tangents, px, py);
  p.X = rays.X;
  p.Y = rays.Y;
  p.valid = works ? rays.valid : 0;
  packet_clear(&p);
#if COUNT_WORK
  tally_clear(p.tally);
#endif

  GroupCandidates candidates;
  candidates.boxes = boxes;
  candidates.stride = stride;
  candidates.begin = works ? offsets[tile] : 0;
  candidates.end = works ? offsets[tile + 1] : 0;
#if LENS
  outermost_rays(&memory, lane, &rays, &candidates);
#else
  candidates.x0 = (group_x + 0.5f - camera.cx) / camera.fx;
  candidates.x1 = (group_x + RS_GROUP_WIDTH - 0.5f - camera.cx) / camera.fx;
  candidates.y0 = (group_y + 0.5f - camera.cy) / camera.fy;
  candidates.y1 = (group_y + RS_GROUP_HEIGHT - 0.5f - camera.cy) / camera.fy;
#endif
  HitStream stream;
  stream.pool = pool;
  stream.transmittance = pool_transmittance;
  stream.capacity = forward.pool_capacity;
  stream.cursor = counters;
  stream_restart(&stream);
#if KEEP_HITS
  if (lane == 0) memory.stream_end = (uint2)(stream.chunk, stream.used);
#endif
#if COUNT_WORK
  tally_clear(stream.tally);
#endif

  bool done = group_in_rows(&memory, &candidates, lane, scene, &p, &stream);
  if (!done) packet_clear(&p);
#if KEEP_HITS
  if (!done && lane == 0) memory.stream_end = (uint2)(RS_NO_CHUNK, CHUNK);
#endif
  bool capped = false;
#if CROWDED
  capped = group_in_passes(&memory, &candidates, lane, !done && p.valid, scene, &p, &stream);
  done = true;
#endif

  if (works && done) {
    packet_store(&p, image, depth_image, transmittances, camera.width, camera.height, px, py,
                 background);
  } else if (works) {
    rs_store_pixels(opacities, camera.width, camera.height, px, py, RS_LEFT);
  }
#if KEEP_HITS
  if (works && lane == 0)
    stream_ends[rs_group_number(camera.width, group_x, group_y)] =
        (uint2)(memory.stream_end.x, memory.stream_end.y | (CROWDED ? RS_STREAM_CROWDED : 0));
#else
  (void)stream_ends;
#endif
#if SUBGROUP
  const uint hits = sub_group_reduce_add((uint)p.hits);
  const uint capped_rays = sub_group_reduce_add(capped ? 1u : 0u);
#else
  rs_group_barrier();
  if (lane < 2) memory.words[lane] = 0;
  rs_group_barrier();
  atomic_add(memory.words, (uint)p.hits);
  if (capped) atomic_inc(memory.words + 1);
  rs_group_barrier();
  const uint hits = memory.words[0], capped_rays = memory.words[1];
#endif
  if (lane == 0) {
#if COUNT_WORK
    tally_add(p.tally, counters);
    tally_add(stream.tally, counters);
#endif
    if (hits != 0) rs_count(counters + 2, hits);
    if (capped_rays != 0) atomic_add(counters + 1, capped_rays);
  }
}
