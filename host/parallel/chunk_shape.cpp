// SPDX-License-Identifier: Apache-2.0
#include "parallel/chunk_shape.hpp"

#include <algorithm>

namespace raysplats {
namespace {

// More chunks than threads even out what other processes take; each costs a row of the digit table.
constexpr std::size_t kChunksPerCpuUnit = 4;
constexpr std::size_t kMinCpuChunk = 4096;
constexpr std::size_t kGroupsPerGpuUnit = 8;
constexpr std::size_t kGpuGroupSize = 256;
constexpr std::size_t kMinGpuTiles = 4;

}  // namespace

ChunkShape ChunkShape::for_device(const DeviceInfo& device) {
  const std::size_t units = std::max<std::size_t>(1, device.compute_units);
  if (device.type == DeviceType::kCpu) return {kChunksPerCpuUnit * units, 1, kMinCpuChunk};
  std::size_t size = kGpuGroupSize;
  while (size > device.max_work_group_size) size /= 2;
  return {kGroupsPerGpuUnit * units, size, kMinGpuTiles * size};
}

std::size_t ChunkShape::chunk(std::size_t count) const {
  const std::size_t even = std::max(min_chunk, (count + groups - 1) / groups);
  return std::max<std::size_t>(1, (even + group_size - 1) / group_size) * group_size;
}

std::size_t ChunkShape::used_groups(std::size_t count) const {
  const std::size_t size = chunk(count);
  return std::max<std::size_t>(1, (count + size - 1) / size);
}

}  // namespace raysplats
