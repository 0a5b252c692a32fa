// SPDX-License-Identifier: Apache-2.0
#include "trace/memory_shares.hpp"

#include <algorithm>
#include <cstdint>

namespace raysplats {
namespace {

// Trained scenes take 0.4 to 0.5 GiB for the hits of 1600x1064 pixels (docs/gpu.md), and buffers
// keep room for a quarter more: that is above the half of the least.
constexpr std::uint64_t kLeast = std::uint64_t{1} << 30;
constexpr std::uint64_t kMost = std::uint64_t{4} << 30;

std::uint64_t own_budget(const DeviceInfo& device) {
  return std::min(std::clamp(device.global_memory / 4, kLeast, kMost), 2 * device.max_allocation);
}

}  // namespace

MemoryShares::MemoryShares(const TraceOptions& options, const DeviceInfo& device)
    : budget_(options.memory_budget != 0 ? options.memory_budget
                                         : static_cast<std::size_t>(own_budget(device))) {}

}  // namespace raysplats
