// SPDX-License-Identifier: Apache-2.0
// Cuts the streams of packets that are work-groups into segments (stream_segment.h) before
// trace_backward_group.
//   list_segments   the segments of every packet of the rows of tiles that pass.tile_row begins.
//                   One work-item per packet, any group. counts: zeros at first. O(chunks) each.
//   sum_segments    of streams of several segments: the sum of each, per ray, and the rows that
//                   reach into those in front. One work-group per segment.
#ifndef TILE
#define TILE 16
#endif

#include "trace/arguments.h"
#include "trace/stream_segment.h"

// Counts the rows of a segment whose last chunk is known; returns the chunk in front of it.
uint list_segment(RsStreamSegment* segment, __global const uint2* pool) {
  uint chunk = segment->chunk;
  uint chunks = 0;
  for (; chunk != RS_NO_CHUNK && chunks < RS_SEGMENT_CHUNKS; ++chunks)
    chunk = pool[(size_t)chunk * CHUNK].x;
  segment->rows = (segment->used & ~RS_STREAM_CROWDED) - 1 + (chunks - 1) * (CHUNK - 1);
  return chunk;
}

__kernel void list_segments(RS_VIEW_ARGUMENTS,
                            const RsBackward pass,
                            __global const uint2* restrict stream_ends,
                            __global const uint2* restrict pool,
                            __global RsStreamSegment* restrict segments,
                            volatile __global uint* restrict counts) {
  (void)tangents;
  const int width = camera_argument.width, height = camera_argument.height;
  const uint first = rs_group_number(width, 0, pass.tile_row * TILE);
  const uint packet = first + get_global_id(0);
  const int2 corner = packet_corner(width, packet);
  if (corner.y >= min((int)(pass.tile_row + pass.tile_rows) * TILE, height)) return;
  if (!rs_on_face(tiles, face, corner.y / TILE * pass.tiles_x + corner.x / TILE)) return;
  const uint2 end = stream_ends[packet];
  RsStreamSegment segment = {packet,         end.x,         end.y,         0,
                             RS_LAST_NUMBER, RS_NO_SEGMENT, RS_NO_SEGMENT, RS_NO_SEGMENT};
  while (segment.chunk != RS_NO_CHUNK) {
    const uint place = atomic_inc(counts + RS_SEGMENT_COUNT);
    const uint next = list_segment(&segment, pool);
    if (next != RS_NO_CHUNK || segment.behind != RS_NO_SEGMENT) {
      segment.slot = atomic_inc(counts + RS_SEGMENT_SLOTS);
      counts[RS_SEGMENT_COUNTS + segment.slot] = 0;
    }
    segments[place] = segment;
    if (segment.behind != RS_NO_SEGMENT) segments[segment.behind].front = place;
    segment.chunk = next;
    segment.used = CHUNK | (end.y & RS_STREAM_CROWDED);
    segment.number -= segment.rows;
    segment.behind = place;
  }
}

// Tells the segments in front of this one of a row that is not settled before theirs are.
void tell_reaching(const RsStreamSegment* segment,
                   const RsReachingRow row,
                   const uint window,
                   __global const RsStreamSegment* segments,
                   volatile __global uint* counts,
                   __global RsReachingRow* reaching) {
  uint place = segment->front;
  while (place != RS_NO_SEGMENT && segments[place].number >= row.number - window) {
    const uint slot = segments[place].slot;
    const uint i = atomic_inc(counts + RS_SEGMENT_COUNTS + slot);
    if (i < RS_SEGMENT_REACHING) reaching[(size_t)slot * RS_SEGMENT_REACHING + i] = row;
    place = segments[place].front;
  }
}

RS_GROUP_KERNEL __kernel void sum_segments(RS_VIEW_ARGUMENTS,
                                           const RsBackward backward_argument,
                                           RS_STREAM_ARGUMENTS(const),
                                           __global const RsLine* restrict lines,
                                           __global const float* restrict image_gradient,
                                           __global const float* restrict depth_gradient,
                                           RS_SEGMENT_ARGUMENTS()) {
  (void)tiles;
  (void)face;
  const RsCamera camera = camera_argument;
  const RsBackward backward = backward_argument;
  const int lane = rs_group_lane();
  const uint place = segment_of_group(get_global_id(0) / GROUP, counts[RS_SEGMENT_COUNT], room);
  if (place == RS_NO_SEGMENT) return;
  const RsStreamSegment segment = segments[place];
  if (segment.slot == RS_NO_SEGMENT) return;
  const BackwardScene scene =
      backward_scene(&camera, &backward, tangents, transmittances, stream_ends, pool,
                     pool_transmittance, lines, image_gradient, depth_gradient, 0);
  Pixels p;
  load_group_pixels(&p, scene, packet_corner(camera.width, segment.packet), lane);
  const uint first = segment.number - segment.rows + 1;
  uint number = segment.number;
  uint chunk = segment.chunk, used = segment.used & ~RS_STREAM_CROWDED;
  float sum = 0.0f;
  while (number >= first) {
    for (uint n = used - 1; n > 0; --n, --number) {
      const RsReachingRow row = {chunk * CHUNK + n, number};
      const StreamHit hit = stream_hit(scene, &p, row.row, lane);
      sum += hit.share;
      if (lane == n % GROUP && number - hit.row.y < first)
        tell_reaching(&segment, row, hit.row.y, segments, counts, reaching);
    }
    chunk = pool[(size_t)chunk * CHUNK].x;
    used = CHUNK;
  }
  segment_sums[(size_t)segment.slot * GROUP + lane] = sum;
}
