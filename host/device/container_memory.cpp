// SPDX-License-Identifier: Apache-2.0
#include "device/container_memory.hpp"

#include <algorithm>
#include <fstream>

namespace raysplats {

std::uint64_t memory_within_container(DeviceType type,
                                      std::uint64_t memory,
                                      const std::filesystem::path& groups) {
  if (type != DeviceType::kCpu) return memory;
  for (const char* name : {"memory.max", "memory/memory.limit_in_bytes"}) {
    std::ifstream stream(groups / name);
    std::uint64_t limit = 0;
    if (stream >> limit) memory = std::min(memory, limit);
  }
  return memory;
}

}  // namespace raysplats
