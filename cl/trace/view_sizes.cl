// SPDX-License-Identifier: Apache-2.0
// Views whose sizes the host does not wait for: its buffers have room for what it expects, and what
// does not fit is left out as a whole. A view then shows nothing and has no gradients, and so have
// all views after it, until the host has seen the word `overflow` and cleared it.
//   admit_candidates   live[0] = candidates that are listed: all of the view's or, without room,
//                      none. live[1] = the first step of their depths. Counts them, in counters of
//                      which `anew` words begin at zero. One work-item.
//   check_streams      forgets all hits when their chunks had no room. One work-item per packet.
#include "bvh/box.h"
#include "parallel/counter.h"
#include "trace/depth_key.h"
#include "trace/view_sizes.h"

// Gaussians that are asked how far away things are.
#define RS_ASKED 8

// The median distance of a few Gaussians, each along the axis of the world where it is greatest;
// the lower of two, and 1 where none of them is anywhere. One that is far from all others, as
// training and file formats leave behind, would take an end of their distances with it.
float median_of_few(__global const RsAabb* boxes, const uint count, const float4 center) {
  float away[RS_ASKED];
  uint found = 0;
#pragma unroll
  for (uint k = 0; k < RS_ASKED; ++k) {
    away[k] = INFINITY;
    if (count == 0) continue;
    const RsBox box = box_load(boxes, (size_t)count * k / RS_ASKED);
    const float4 way = fabs(box_center(box) - center);
    const float most = fmax(fmax(way.x, way.y), way.z);
    if (!box_valid(box) || !(most > 0.0f && most <= FLT_MAX)) continue;
    away[k] = most;
    ++found;
  }
  float median = 1.0f;
#pragma unroll
  for (uint k = 0; k < RS_ASKED; ++k) {
    uint nearer = 0;
#pragma unroll
    for (uint j = 0; j < RS_ASKED; ++j)
      nearer += away[j] < away[k] || (away[j] == away[k] && j < k) ? 1 : 0;
    if (found > 0 && nearer == (found - 1) / 2) median = away[k];
  }
  return median;
}

// offsets[count] is the number of candidates, `boxes` are those of the Gaussians.
__kernel void admit_candidates(__global const uint* offsets,
                               const uint count,
                               __global const RsAabb* boxes,
                               const RsCamera camera,
                               const uint capacity,
                               const uint anew,
                               __global uint* live,
                               volatile __global uint* counters,
                               __global uint* overflow) {
  const uint wanted = offsets[count];
  if (wanted > capacity) overflow[0] = 1;
  live[0] = overflow[0] == 0 ? wanted : 0;
  const float4 center = (float4)(camera.center[0], camera.center[1], camera.center[2], 0.0f);
  live[1] = first_depth_step(median_of_few(boxes, count, center));
  for (uint k = 0; k < anew; ++k) counters[k] = 0;
  rs_count(counters + RS_COUNT_CANDIDATES, wanted);
}

__kernel void check_streams(const uint packets,
                            const uint capacity,
                            __global const uint* counters,
                            __global uint* overflow,
                            __global uint2* stream_ends) {
  const uint i = get_global_id(0);
  if (i >= packets || counters[RS_COUNT_CHUNKS] <= capacity) return;
  stream_ends[i] = (uint2)(RS_NO_CHUNK, 0);
  if (i == 0) overflow[0] = 1;
}
