// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <nlohmann/json.hpp>

#include "raysplats/device.hpp"

namespace raysplats {

/// "CPU", "GPU", "accelerator" or "other".
const char* device_type_name(DeviceType type);

/// All that is known of a device, as `raysplats devices --json` writes it.
nlohmann::ordered_json device_json(const DeviceInfo& device);

}  // namespace raysplats
