// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>

#include "raysplats/device.hpp"

namespace raysplats {

/// Block of camera rays that one work-item traces, and the square tile whose packets share a
/// candidate list.
struct PacketShape {
  int lanes = 1;
  int width = 1;     ///< pixels
  int height = 1;    ///< pixels
  int block = 1;     ///< packets a side that one work-item of the forward pass traces
  int tile = 16;     ///< pixels
  int pending = 64;  ///< entries of the per-lane sorted list
  int group = 0;     ///< most work-items of a work-group; 0 = all packets of a tile
};

/// `lanes` of 1, 2, 4, 8 or 16; 0 takes the device's tuning, or without one its float vector width
/// on CPUs and 1 elsewhere. The rest follows the tuning when that has the same width.
/// Throws UsageError for other widths.
PacketShape packet_shape(const DeviceInfo& device, int lanes);

/// Work-group of packets: those of a tile, halved until at most `limit` work-items are left.
std::array<std::size_t, 2> packet_group(const PacketShape& packet, std::size_t limit);

}  // namespace raysplats
