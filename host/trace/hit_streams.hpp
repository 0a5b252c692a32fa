// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "device/kernel.hpp"

namespace raysplats {

/// The hits of the packets of a view, for its backward pass: streams in chunks of a shared pool
/// (cl/trace/hit_stream.h), which grows with the views but no further than its share of the memory
/// budget.
class HitStreams {
 public:
  /// Rows of a chunk, the CHUNK of hit_stream.h.
  static constexpr std::uint32_t kChunkRows = 16;

  /// `lanes` are the rays of a packet. `share` in bytes, for the pool and for what others keep
  /// `beside` each of its chunks.
  HitStreams(Context& context, int lanes, std::size_t beside, std::size_t share);

  /// Room for what pixels and packets have one of each; next to none where no hits are `kept`.
  void prepare(std::size_t pixels, std::size_t packets, bool kept);
  /// Makes room for `chunks` and a quarter more as far as the share allows, and for `least` at any
  /// rate. Where that throws there is room for none.
  void grow(std::size_t chunks, std::size_t least = 1);

  std::size_t chunk_bytes() const { return kChunkRows * (sizeof(Row) + row_bytes()); }
  /// Chunks of the pool as it is.
  std::size_t capacity() const { return capacity_; }
  /// Chunks that fit the share.
  std::size_t limit() const;
  /// Chunks that the device and their 32-bit addresses allow.
  std::size_t largest() const;
  /// Chunks that a whole view may use: a row of tiles that needed more than its share left the pool
  /// larger.
  std::size_t view_room() const;

  /// Raises overflow[0] and empties the streams where a view took more than `room` chunks.
  void check(std::size_t packets,
             std::uint32_t room,
             const Buffer<std::uint32_t>& counters,
             const Buffer<std::uint32_t>& overflow);

  auto& ends() const { return ends_; }
  auto& pool() const { return pool_; }
  /// RS_STREAM_ARGUMENTS of cl/trace/arguments.h.
  auto arguments() const {
    return argument_pack(transmittances_, ends_, pool_, pool_transmittance_);
  }

 private:
  using Row = std::array<std::uint32_t, 2>;

  std::size_t row_bytes() const { return sizeof(float) * lanes_; }

  Context& context_;
  std::size_t lanes_;
  std::size_t beside_;
  std::size_t share_;
  Buffer<float> transmittances_;  // of pixels: behind the last hit, before it
  Buffer<Row> ends_;              // of packets
  Buffer<Row> pool_;
  Buffer<float> pool_transmittance_;
  std::size_t capacity_ = 0;
  Kernel check_;
};

}  // namespace raysplats
