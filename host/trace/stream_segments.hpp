// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "shared/segment_layout.h"

namespace raysplats {

/// Room for the segments into which hit streams are cut for the backward pass of packets that are
/// work-groups (cl/trace/stream_segment.h). It follows from the packets and from the chunks of the
/// pool: the device alone knows how many segments there are.
class StreamSegments {
 public:
  /// `lanes` are the rays of a packet.
  StreamSegments(Context& context, int lanes);

  /// Bytes that each chunk of the pool brings with it.
  static std::size_t chunk_bytes(int lanes);
  /// Room for the segments of `packets` whose streams have `chunks` together. None are listed.
  void prepare(std::size_t packets, std::size_t chunks);
  /// The most segments that there may be.
  std::uint32_t room() const { return static_cast<std::uint32_t>(segments_.size()); }

  const Buffer<RsStreamSegment>& segments() const { return segments_; }
  const Buffer<std::uint32_t>& counts() const { return counts_; }
  /// RS_SEGMENT_ARGUMENTS of cl/trace/stream_segment.h.
  auto arguments() const { return argument_pack(room(), segments_, counts_, sums_, reaching_); }

 private:
  Context& context_;
  std::size_t lanes_;
  Buffer<RsStreamSegment> segments_;
  Buffer<std::uint32_t> counts_;
  Buffer<float> sums_;
  Buffer<RsReachingRow> reaching_;
};

}  // namespace raysplats
