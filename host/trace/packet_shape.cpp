// SPDX-License-Identifier: Apache-2.0
#include "trace/packet_shape.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "raysplats/error.hpp"

namespace raysplats {

PacketShape packet_shape(const DeviceInfo& device, int lanes) {
  const bool cpu = device.type == DeviceType::kCpu;
  if (lanes == 0 && device.tuning) {
    lanes = device.tuning->packet_width;
  } else if (lanes == 0) {
    lanes = 1;
    while (cpu && lanes < 16 && static_cast<std::uint32_t>(2 * lanes) <= device.float_vector_width)
      lanes *= 2;
  }
  PacketShape shape;
  shape.lanes = lanes;
  // Single rays are for devices that run many work-items at once: they have no room for queues.
  shape.block = lanes > 1 ? 2 : 1;
  switch (lanes) {
    case 1:
      break;
    case 2:
      shape.width = 2;
      break;
    case 4:
      shape.width = shape.height = 2;
      break;
    case 8:
      shape.width = 4;
      shape.height = 2;
      break;
    case 16:
      shape.width = shape.height = 4;
      break;
    default:
      throw UsageError(fmt::format("--packet-width {}: choose 1, 2, 4, 8 or 16", lanes));
  }
  // CPUs gain from shared lists of larger tiles; GPUs need many small groups.
  shape.tile = cpu ? 32 : 16;
  shape.pending = cpu ? 96 : 48;
  if (device.tuning && device.tuning->packet_width == lanes) {
    shape.tile = device.tuning->tile;
    shape.pending = device.tuning->pending;
    shape.group = device.tuning->group;
  }
  return shape;
}

std::array<std::size_t, 2> packet_group(const PacketShape& packet, std::size_t limit) {
  std::array<std::size_t, 2> group{static_cast<std::size_t>(packet.tile / packet.width),
                                   static_cast<std::size_t>(packet.tile / packet.height)};
  if (packet.group > 0) limit = std::min(limit, static_cast<std::size_t>(packet.group));
  while (group[0] * group[1] > std::max<std::size_t>(limit, 1)) {
    std::size_t& longer = group[0] >= group[1] ? group[0] : group[1];
    longer /= 2;
  }
  return group;
}

}  // namespace raysplats
