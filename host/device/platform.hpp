// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "device/cl.hpp"
#include "raysplats/device.hpp"

namespace raysplats {

struct PlatformDevice {
  DeviceInfo info;
  cl::Device device;
};

/// Every device of every platform with its handle, in list_devices() order.
std::vector<PlatformDevice> platform_devices();

/// What select_device() chooses among `devices`, of which there is at least one.
DeviceInfo select_among(const std::vector<DeviceInfo>& devices, const std::string& selector);

}  // namespace raysplats
