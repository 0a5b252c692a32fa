// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <vector>

#include "raysplats/device.hpp"

namespace raysplats {

/// The parts of a list with commas. Names of devices may hold commas themselves (Mesa's do): of the
/// parts that together are in one of `names`, in any case, as many as possible stay one. Throws
/// UsageError for a list with nothing beside a comma.
std::vector<std::string> device_selectors(const std::string& list,
                                          std::span<const std::string> names);

/// The devices of a list with commas, each as select_device() has it. One may be named more than
/// once. Throws what select_device() throws, UsageError for a list with nothing beside a comma.
std::vector<DeviceInfo> select_devices(const std::string& selectors);

/// All usable devices of its type and name, it among them, in the order of list_devices().
std::vector<DeviceInfo> devices_like(const DeviceInfo& device);

}  // namespace raysplats
