// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "raysplats/device.hpp"

namespace raysplats {

/// The define LANES of kernels that take several pixels or numbers at once: `requested`, or what
/// suits the device when that is 0. Throws UsageError for a width without kernels.
int lane_count(const DeviceInfo& device, int requested);

}  // namespace raysplats
