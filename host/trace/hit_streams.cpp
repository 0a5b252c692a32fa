// SPDX-License-Identifier: Apache-2.0
#include "trace/hit_streams.hpp"

#include <algorithm>
#include <limits>

namespace raysplats {
namespace {

constexpr std::size_t kGroup = 64;

}  // namespace

HitStreams::HitStreams(Context& context, int lanes, std::size_t beside, std::size_t share)
    : context_(context),
      lanes_(static_cast<std::size_t>(lanes)),
      beside_(beside),
      share_(share),
      check_(context.kernel("trace/view_sizes.cl", "check_streams")) {}

void HitStreams::prepare(std::size_t pixels, std::size_t packets, bool kept) {
  transmittances_.ensure(context_, kept ? 2 * pixels : 1, "transmittances");
  ends_.ensure(context_, kept ? packets : 1, "hit streams");
}

void HitStreams::grow(std::size_t chunks, std::size_t least) {
  const std::size_t room =
      std::max<std::size_t>({std::min(chunks + chunks / 4, limit()), least, std::size_t{1}});
  capacity_ = 0;
  pool_.ensure(context_, room * kChunkRows, "hit pool");
  pool_transmittance_.ensure(context_, room * kChunkRows * lanes_, "hit transmittances");
  capacity_ = room;
}

std::size_t HitStreams::limit() const {
  return std::min(share_ / (chunk_bytes() + beside_), largest());
}

std::size_t HitStreams::largest() const {
  return std::min<std::size_t>(
      context_.device().max_allocation / (kChunkRows * std::max(sizeof(Row), row_bytes())),
      std::numeric_limits<std::uint32_t>::max() / kChunkRows);
}

std::size_t HitStreams::view_room() const { return std::min(capacity_, limit()); }

void HitStreams::check(std::size_t packets,
                       std::uint32_t room,
                       const Buffer<std::uint32_t>& counters,
                       const Buffer<std::uint32_t>& overflow) {
  check_.launch(Range::linear(packets, kGroup), static_cast<std::uint32_t>(packets), room, counters,
                overflow, ends_);
}

}  // namespace raysplats
