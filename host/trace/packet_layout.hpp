// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>

#include "raysplats/device.hpp"
#include "raysplats/trace_options.hpp"

namespace raysplats {

/// Block of camera rays that one work-item or one work-group traces, and the square tile whose
/// packets share a candidate list.
struct PacketLayout {
  bool grouped = false;    ///< a lane is a work-item (cl/trace/group.h), not a lane of a vector
  bool subgroups = false;  ///< and each work-group is one subgroup, if the compiler says so
  bool sized = false;      ///< which is demanded of a compiler that can choose the size
  int lanes = 1;
  int width = 1;      ///< pixels
  int height = 1;     ///< pixels
  int block = 1;      ///< packets a side that one work-item of the forward pass traces
  int tile = 16;      ///< pixels
  int pending = 64;   ///< rows, or entries of a lane's sorted list, at once
  int group = 0;      ///< most work-items of a work-group; 0 = all packets of a tile
  int stretches = 1;  ///< of a launch, whose tiles take turns (cl/trace/camera_forward.cl)
  /// Rows of crowded packets (CROWDED in cl/trace/group.h) that local memory holds, in the forward
  /// and in the backward pass.
  std::array<int, 2> crowded_rows{};
};

/// Lanes and shape as the options say; what they leave open is the device's tuning, or without one
/// vectors twice as wide as the device's own (at most 16) on CPUs and elsewhere subgroups, or
/// groups, of 32, or single rays where local memory is short. The rest follows the tuning when that
/// has the same shape and width. Throws UsageError for other widths, DeviceError for what the
/// device does not have.
PacketLayout packet_layout(const DeviceInfo& device, const TraceOptions& options);

PacketShape tuned_shape(const DeviceTuning& tuning);

/// Work-group of packets: those of a tile, halved until at most `limit` work-items are left.
std::array<std::size_t, 2> packet_group(const PacketLayout& packet, std::size_t limit);

}  // namespace raysplats
