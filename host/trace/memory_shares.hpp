// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

namespace raysplats {

/// How TraceOptions::memory_budget (`budget`, bytes) is shared out. What is held at the same time
/// adds up to no more than all of it: the first three by packets of camera rays, the next two by
/// rays one by one with gradients, the last ones by pictures of rays and of paths.
class MemoryShares {
 public:
  constexpr explicit MemoryShares(std::size_t budget) : budget_(budget) {}

  /// Hits kept for the backward pass.
  constexpr std::size_t hit_streams() const { return budget_ / 2; }
  constexpr std::size_t tile_lists() const { return budget_ / 4; }
  /// Private copies of line gradients.
  constexpr std::size_t packet_gradients() const { return budget_ / 4; }

  /// Private copies of the gradients of rays.
  constexpr std::size_t ray_gradients() const { return budget_ / 2; }
  /// A batch of camera rays with results and gradients.
  constexpr std::size_t ray_batch() const { return budget_ / 4; }

  /// Rays and results on their way from and to the host.
  constexpr std::size_t host_rays() const { return budget_ / 2; }
  /// Paths of PathTracer with what they carry.
  constexpr std::size_t paths() const { return budget_ / 2; }

 private:
  std::size_t budget_;
};

}  // namespace raysplats
