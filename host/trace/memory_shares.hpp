// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>

#include "raysplats/device.hpp"
#include "raysplats/trace_options.hpp"

namespace raysplats {

/// What may be taken of a device's memory: the driver and other programs need some of it too.
inline std::uint64_t usable_memory(const DeviceInfo& device) {
  return device.global_memory / 10 * 9;
}

/// How TraceOptions::memory_budget is shared out. What is held at the same time
/// adds up to no more than all of it: the first three by packets of camera rays, the next two by
/// rays one by one with gradients, the last ones by pictures of rays and of paths.
class MemoryShares {
 public:
  MemoryShares(const TraceOptions& options, const DeviceInfo& device);

  /// What is shared out, in bytes. Without a budget in the options a quarter of the device's
  /// memory, from 1 to 4 GiB; never more than two of its largest buffers, because half of it is
  /// one.
  std::size_t all() const { return budget_; }

  /// Hits kept for the backward pass, and their segments.
  std::size_t hit_streams() const { return budget_ / 2; }
  std::size_t tile_lists() const { return budget_ / 4; }
  /// Private copies of line gradients; those that take less than exact sums may go beyond it
  /// (GradientSumChoice).
  std::size_t packet_gradients() const { return budget_ / 4; }

  /// Private copies of the gradients of rays.
  std::size_t ray_gradients() const { return budget_ / 2; }
  /// A batch of camera rays with results and gradients.
  std::size_t ray_batch() const { return budget_ / 4; }

  /// Rays and results on their way from and to the host.
  std::size_t host_rays() const { return budget_ / 2; }
  /// Paths of PathTracer with what they carry.
  std::size_t paths() const { return budget_ / 2; }

 private:
  std::size_t budget_;
};

}  // namespace raysplats
