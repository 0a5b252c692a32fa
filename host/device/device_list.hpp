// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "raysplats/device.hpp"

namespace raysplats {

/// The devices of a list with commas, each as select_device() has it. One may be named more than
/// once. Throws what select_device() throws, UsageError for a list with nothing beside a comma.
std::vector<DeviceInfo> select_devices(const std::string& selectors);

/// All usable devices of its type and name, it among them, in the order of list_devices().
std::vector<DeviceInfo> devices_like(const DeviceInfo& device);

}  // namespace raysplats
