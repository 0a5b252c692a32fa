// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "raysplats/device.hpp"

namespace raysplats {

/// How a chunked kernel is spread over a device: at most `groups` work-groups of `group_size`
/// work-items (1 or a power of two), each of which walks one contiguous chunk of at least
/// `min_chunk` elements.
struct ChunkShape {
  std::size_t groups = 1;
  std::size_t group_size = 1;
  std::size_t min_chunk = 1;

  /// CPUs: a few sequential chunks per compute unit. Everything else: many cooperating groups.
  static ChunkShape for_device(const DeviceInfo& device);

  /// Elements per group for `count` elements: a multiple of group_size, at least 1.
  std::size_t chunk(std::size_t count) const;
  /// Groups that `count` elements need, at least 1 and at most `groups`.
  std::size_t used_groups(std::size_t count) const;
};

}  // namespace raysplats
