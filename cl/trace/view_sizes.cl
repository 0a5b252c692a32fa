// SPDX-License-Identifier: Apache-2.0
// Views whose sizes the host does not wait for: its buffers have room for what it expects, and what
// does not fit is left out as a whole. A view then shows nothing and has no gradients, and so have
// all views after it, until the host has seen the word `overflow` and cleared it.
//   admit_candidates   live[0] = candidates that are listed: all of the view's or, without room,
//                      none. One work-item.
//   check_streams      forgets all hits when their chunks had no room. One work-item per packet.
#include "parallel/counter.h"
#include "trace/view_sizes.h"

// offsets[count] is the number of candidates.
__kernel void admit_candidates(__global const uint* offsets,
                               const uint count,
                               const uint capacity,
                               __global uint* live,
                               volatile __global uint* counters,
                               __global uint* overflow) {
  const uint wanted = offsets[count];
  if (wanted > capacity) overflow[0] = 1;
  live[0] = overflow[0] == 0 ? wanted : 0;
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
