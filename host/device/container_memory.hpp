// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>

#include "raysplats/device.hpp"

namespace raysplats {

/// Bytes of a device's `memory` that this process can have: of a CPU no more than the container
/// that it is in may take, which drivers do not know. `groups` is where the system tells the limits
/// of control groups, of either version; a file that is missing or holds no number is no limit.
std::uint64_t memory_within_container(DeviceType type,
                                      std::uint64_t memory,
                                      const std::filesystem::path& groups = "/sys/fs/cgroup");

}  // namespace raysplats
