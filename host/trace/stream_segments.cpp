// SPDX-License-Identifier: Apache-2.0
#include "trace/stream_segments.hpp"

namespace raysplats {

StreamSegments::StreamSegments(Context& context, int lanes)
    : context_(context), lanes_(static_cast<std::size_t>(lanes)) {}

// A stream of one chunk more than a segment has two segments, with a slot each.
std::size_t StreamSegments::chunk_bytes(int lanes) {
  const std::size_t slot = sizeof(std::uint32_t) + static_cast<std::size_t>(lanes) * sizeof(float) +
                           RS_SEGMENT_REACHING * sizeof(RsReachingRow);
  return (sizeof(RsStreamSegment) + 2 * slot) / RS_SEGMENT_CHUNKS;
}

void StreamSegments::prepare(std::size_t packets, std::size_t chunks) {
  const std::size_t whole = chunks / RS_SEGMENT_CHUNKS;
  const std::size_t slots = 2 * whole;
  segments_.ensure(context_, packets + whole, "stream segments");
  counts_.ensure(context_, RS_SEGMENT_COUNTS + slots, "counts of segments");
  sums_.ensure(context_, slots * lanes_, "sums of segments");
  reaching_.ensure(context_, slots * RS_SEGMENT_REACHING, "rows that reach into segments");
  counts_.clear(RS_SEGMENT_COUNTS);
}

}  // namespace raysplats
