// SPDX-License-Identifier: Apache-2.0
#include "trace/packet_shape.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

// Local memory that the kernels of a group take, with room to spare: rows of three floats per ray
// (group_rows.h, group_backward.cl) and what is as long as the group is wide.
std::uint64_t group_local_memory(int lanes) {
  return 4096 + 420 * static_cast<std::uint64_t>(lanes);
}

// Fits one hardware thread of most GPUs; more rays share more rows, and their local memory leaves
// room for fewer groups.
constexpr int kGroupLanes = 32;

bool takes_groups(const DeviceInfo& device, int lanes) {
  return static_cast<std::size_t>(lanes) <= device.max_work_group_size &&
         group_local_memory(lanes) <= device.local_memory;
}

PacketForm default_form(const DeviceInfo& device, int lanes) {
  const bool cpu = device.type == DeviceType::kCpu;
  const PacketForm group =
      device.has_subgroups && !cpu ? PacketForm::kSubgroup : PacketForm::kGroup;
  if (lanes > 16) return group;
  if (lanes > 0 || cpu) return PacketForm::kVector;
  return takes_groups(device, kGroupLanes) ? group : PacketForm::kVector;
}

int default_lanes(const DeviceInfo& device, PacketForm form) {
  if (form != PacketForm::kVector) return kGroupLanes;
  const std::uint32_t own = device.float_vector_width;
  if (device.type != DeviceType::kCpu || own < 2) return 1;
  // Two of the device's vectors: what a packet does once is shared by more rays.
  int lanes = 2;
  while (lanes < 16 && static_cast<std::uint32_t>(lanes) <= own) lanes *= 2;
  return lanes;
}

}  // namespace

PacketForm tuned_form(const DeviceTuning& tuning) {
  if (!tuning.grouped) return PacketForm::kVector;
  return tuning.subgroups ? PacketForm::kSubgroup : PacketForm::kGroup;
}

PacketShape packet_shape(const DeviceInfo& device, const TraceOptions& options) {
  PacketForm form = options.packet_form;
  int lanes = options.packet_width;
  const auto& tuning = device.tuning;
  if (form == PacketForm::kSubgroup && !device.has_subgroups) {
    throw DeviceError(
        fmt::format("{} has no subgroups (cl_khr_subgroups): choose --packet-shape group, vector "
                    "or auto",
                    device.name));
  }
  bool sized = form == PacketForm::kSubgroup;
  if (tuning && lanes == 0 && (form == PacketForm::kAuto || form == tuned_form(*tuning)) &&
      (device.has_subgroups || !tuning->subgroups)) {
    form = tuned_form(*tuning);
    lanes = tuning->packet_width;
    sized = tuning->subgroups;
  }
  if (form == PacketForm::kAuto) form = default_form(device, lanes);
  if (lanes == 0) lanes = default_lanes(device, form);

  PacketShape shape;
  shape.grouped = form != PacketForm::kVector;
  shape.subgroups = form == PacketForm::kSubgroup;
  shape.sized = shape.subgroups && sized;
  shape.lanes = lanes;
  // Single rays are for devices that run many work-items at once: they have no room for queues.
  shape.block = lanes > 1 && !shape.grouped ? 2 : 1;
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
    case 32:
      shape.width = 8;
      shape.height = 4;
      break;
    case 64:
      shape.width = shape.height = 8;
      break;
    default:
      lanes = 0;
  }
  if (lanes == 0 || (shape.grouped ? lanes < 8 : lanes > 16)) {
    throw UsageError(
        shape.grouped
            ? fmt::format("--packet-width {} in a group: choose 8, 16, 32 or 64", shape.lanes)
            : fmt::format("--packet-width {}: choose 1, 2, 4, 8 or 16, or 32 or 64 in "
                          "a group",
                          shape.lanes));
  }
  if (shape.grouped && !takes_groups(device, lanes)) {
    throw DeviceError(fmt::format(
        "{} has {} work-items and {} bytes of local memory a work-group, packets of {} "
        "work-items need more: choose --packet-shape vector or a smaller --packet-width",
        device.name, device.max_work_group_size, device.local_memory, lanes));
  }
  // CPUs gain from shared lists of larger tiles; GPUs need many small groups.
  const bool cpu = device.type == DeviceType::kCpu;
  shape.tile = cpu ? 32 : 16;
  shape.pending = cpu ? 96 : 48;
  if (tuning && tuned_form(*tuning) == form && tuning->packet_width == lanes) {
    shape.tile = tuning->tile;
    shape.pending = tuning->pending;
    shape.group = tuning->group;
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
