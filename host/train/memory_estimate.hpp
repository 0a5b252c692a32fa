// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "raysplats/device.hpp"
#include "raysplats/train_options.hpp"

namespace raysplats {

/// What a training run wants to hold.
struct MemoryDemand {
  std::size_t gaussians = 0;    ///< most that it may reach
  std::size_t pixels = 0;       ///< of the largest view
  std::size_t views = 0;        ///< photos to train on
  std::size_t ray_views = 0;    ///< of these, traced ray by ray (ViewTracer::by_rays())
  std::size_t triangles = 0;    ///< of mirrors
  std::size_t photo_words = 1;  ///< of 32 bits, of a pixel of a photo (io::Photo)
  std::size_t depth_maps = 0;   ///< of the views, with a map of their depths that is heeded
};

/// Device memory that a training run will need, in bytes.
struct MemoryEstimate {
  /// Parameters, gradients, Adam moments, statistics, least scales, the second copy while
  /// densifying.
  std::size_t gaussians = 0;
  std::size_t tracing = 0;  ///< records per view, sums of gradients and sort buffers
  std::size_t rays = 0;     ///< views traced ray by ray: tree, sums of gradients, rays (of mirrors:
                            ///< two segments of a path), meshes
  std::size_t images = 0;   ///< photos and depth maps within their budget, the buffers of one view
  std::size_t hits = 0;  ///< hit streams, tile lists and private gradients: memory-budget at most
  std::size_t largest_buffer = 0;
  std::size_t total() const { return gaussians + tracing + rays + images + hits; }
};

MemoryEstimate estimate_memory(const TrainOptions& options,
                               const MemoryDemand& demand,
                               const DeviceInfo& device);

/// Whether the device has that much, with a tenth left for the driver and other programs.
bool fits(const MemoryEstimate& estimate, const DeviceInfo& device);

/// The most Gaussians with which a run of these views fits; 0 when none do.
std::size_t gaussians_that_fit(const TrainOptions& options,
                               const MemoryDemand& demand,
                               const DeviceInfo& device);

/// Throws ResourceError with the figures, and how many Gaussians would fit, when the device has
/// less than the run needs.
void check_memory(const TrainOptions& options,
                  const MemoryDemand& demand,
                  const DeviceInfo& device);

}  // namespace raysplats
