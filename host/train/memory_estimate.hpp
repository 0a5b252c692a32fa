// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "raysplats/device.hpp"
#include "raysplats/train_options.hpp"

namespace raysplats {

/// Device memory that a training run will need, in bytes, from the largest number of Gaussians it
/// may reach.
struct MemoryEstimate {
  std::size_t gaussians =
      0;  ///< parameters, gradients, Adam moments, the second copy while densifying
  std::size_t tracing = 0;  ///< records per view, tree and sort buffers
  std::size_t images = 0;   ///< photos within their budget, and the buffers of one view
  std::size_t hits = 0;     ///< memory-budget
  std::size_t largest_buffer = 0;
  std::size_t total() const { return gaussians + tracing + images + hits; }
};

/// `pixels` of the largest view, `views` photos to train on.
MemoryEstimate estimate_memory(const TrainOptions& options,
                               std::size_t max_gaussians,
                               std::size_t pixels,
                               std::size_t views);

/// Throws ResourceError with the figures when the device has less than that.
void check_memory(const MemoryEstimate& estimate, const DeviceInfo& device);

}  // namespace raysplats
