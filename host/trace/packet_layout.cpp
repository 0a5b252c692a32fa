// SPDX-License-Identifier: Apache-2.0
#include "trace/packet_layout.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

// Local memory that the kernels of a group may take, with 1 KiB to spare for what compilers add.
// Bytes per ray: 192 for the open rows, in the forward pass (ForwardMemory of group_rows.h) 8 more
// for the queue, in the backward pass (BackwardMemory of group_backward.cl) 40 more for the sums.
// The rest does not grow with the rays, but for the rows that wait: 1568 bytes up to 32 rays, 2336
// for 64. As compiled: 7968 bytes for 32 rays, 15136 for 64 (scripts/gpu/baseline.json).
std::uint64_t group_local_memory(int lanes) {
  return 1536 + 232 * static_cast<std::uint64_t>(lanes);
}

// Fits one hardware thread of most GPUs; more rays share more rows, and their local memory leaves
// room for fewer groups.
constexpr int kGroupLanes = 32;

// Open rows that find room there, of the 64 of a crowded packet, at `bytes` a ray and row: as
// above, with twice the rows that wait.
int crowded_rows(const DeviceInfo& device, int lanes, std::uint64_t bytes) {
  const auto rays = static_cast<std::uint64_t>(lanes);
  const std::uint64_t others = 3072 + 48 * rays;
  const std::uint64_t room = device.local_memory > others ? device.local_memory - others : 0;
  return static_cast<int>(std::clamp<std::uint64_t>(room / (bytes * rays) / 8 * 8, 8, 64));
}

bool takes_groups(const DeviceInfo& device, int lanes) {
  return static_cast<std::size_t>(lanes) <= device.max_work_group_size &&
         group_local_memory(lanes) <= device.local_memory;
}

PacketShape default_shape(const DeviceInfo& device, int lanes) {
  const bool cpu = device.type == DeviceType::kCpu;
  const PacketShape group =
      device.has_subgroups && !cpu ? PacketShape::kSubgroup : PacketShape::kGroup;
  if (lanes > 16) return group;
  if (lanes > 0 || cpu) return PacketShape::kVector;
  return takes_groups(device, kGroupLanes) ? group : PacketShape::kVector;
}

int default_lanes(const DeviceInfo& device, PacketShape shape) {
  if (shape != PacketShape::kVector) return kGroupLanes;
  const std::uint32_t own = device.float_vector_width;
  if (device.type != DeviceType::kCpu || own < 2) return 1;
  // Two of the device's vectors: what a packet does once is shared by more rays.
  int lanes = 2;
  while (lanes < 16 && static_cast<std::uint32_t>(lanes) <= own) lanes *= 2;
  return lanes;
}

/// What the options say, and what they leave open.
struct PacketChoice {
  PacketShape shape;
  int lanes;
  bool sized;  ///< a compiler that can choose the size of subgroups is to give them so many lanes
};

PacketChoice choose_packets(const DeviceInfo& device, const TraceOptions& options) {
  PacketChoice choice{options.packet_shape, options.packet_width,
                      options.packet_shape == PacketShape::kSubgroup};
  if (choice.sized && !device.has_subgroups) {
    throw DeviceError(
        fmt::format("{} has no subgroups (cl_khr_subgroups): choose --packet-shape group, vector "
                    "or auto",
                    device.name));
  }
  const auto& tuning = device.tuning;
  if (tuning && choice.lanes == 0 &&
      (choice.shape == PacketShape::kAuto || choice.shape == tuned_shape(*tuning)) &&
      (device.has_subgroups || !tuning->subgroups))
    return {tuned_shape(*tuning), tuning->packet_width, tuning->subgroups};
  if (choice.shape == PacketShape::kAuto) choice.shape = default_shape(device, choice.lanes);
  if (choice.lanes == 0) choice.lanes = default_lanes(device, choice.shape);
  return choice;
}

/// Throws unless there are packets of so many rays in that shape, and the device has room for them.
void check_lanes(const DeviceInfo& device, int lanes, bool grouped) {
  const bool known = std::has_single_bit(static_cast<unsigned>(std::max(lanes, 0)));
  if (grouped && !(known && lanes >= 8 && lanes <= 64))
    throw UsageError(fmt::format("--packet-width {} in a group: choose 8, 16, 32 or 64", lanes));
  if (!grouped && !(known && lanes <= 16)) {
    throw UsageError(
        fmt::format("--packet-width {}: choose 1, 2, 4, 8 or 16, or 32 or 64 in a group", lanes));
  }
  if (grouped && !takes_groups(device, lanes)) {
    throw DeviceError(fmt::format(
        "{} has {} work-items and {} bytes of local memory a work-group, packets of {} "
        "work-items need more: choose --packet-shape vector or a smaller --packet-width",
        device.name, device.max_work_group_size, device.local_memory, lanes));
  }
}

}  // namespace

PacketShape tuned_shape(const DeviceTuning& tuning) {
  if (!tuning.grouped) return PacketShape::kVector;
  return tuning.subgroups ? PacketShape::kSubgroup : PacketShape::kGroup;
}

PacketLayout packet_layout(const DeviceInfo& device, const TraceOptions& options) {
  const auto [shape, lanes, sized] = choose_packets(device, options);
  PacketLayout layout;
  layout.grouped = shape != PacketShape::kVector;
  layout.subgroups = shape == PacketShape::kSubgroup;
  layout.sized = layout.subgroups && sized;
  layout.lanes = lanes;
  check_lanes(device, lanes, layout.grouped);
  // Single rays are for devices that run many work-items at once: they have no room for queues.
  layout.block = lanes > 1 && !layout.grouped ? 2 : 1;
  // A square, or twice as wide as high.
  while (layout.width * layout.height < lanes)
    (layout.width > layout.height ? layout.height : layout.width) *= 2;
  // CPUs gain from shared lists of larger tiles; GPUs need many small groups.
  const bool cpu = device.type == DeviceType::kCpu;
  layout.tile = cpu ? 32 : 16;
  layout.pending = cpu ? 192 : 48;
  // A CPU's driver hands out many neighbouring groups at once: where they are small and from all
  // over the picture, every thread has as much to do.
  layout.group = cpu ? 1 : 0;
  if (cpu && device.compute_units > 1)
    layout.stretches = static_cast<int>(std::clamp(2 * device.compute_units, 4u, 16u));
  const auto& tuning = device.tuning;
  if (tuning && tuned_shape(*tuning) == shape && tuning->packet_width == lanes) {
    layout.tile = tuning->tile;
    layout.pending = tuning->pending;
    layout.group = tuning->group;
  }
  if (layout.grouped)
    layout.crowded_rows = {crowded_rows(device, lanes, 12), crowded_rows(device, lanes, 8)};
  return layout;
}

std::array<std::size_t, 2> packet_group(const PacketLayout& packet, std::size_t limit) {
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
