// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "raysplats/device.hpp"

namespace raysplats {

/// The define VECTOR of cl/train/lanes.h: `requested`, or what suits the device when that is 0.
/// Throws UsageError for a width without kernels.
int lane_count(const DeviceInfo& device, int requested);

}  // namespace raysplats
