// SPDX-License-Identifier: Apache-2.0
#include "train/optimizer/lanes.hpp"

#include <fmt/format.h>

#include "raysplats/error.hpp"

namespace raysplats {

int lane_count(const DeviceInfo& device, int requested) {
  if (requested == 1 || requested == 4 || requested == 8 || requested == 16) return requested;
  if (requested != 0) {
    throw UsageError(
        fmt::format("There are no kernels for vectors of {}; use 1, 4, 8 or 16", requested));
  }
  // GPUs hide latency by many work-items, where vectors only take registers; a CPU fills its lanes
  // from one.
  if (device.type != DeviceType::kCpu) return 1;
  if (device.float_vector_width >= 16) return 16;
  return device.float_vector_width >= 8 ? 8 : 4;
}

}  // namespace raysplats
