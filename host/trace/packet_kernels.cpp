// SPDX-License-Identifier: Apache-2.0
#include "trace/packet_kernels.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "raysplats/error.hpp"
#include "trace/hit_streams.hpp"

namespace raysplats {

PacketKernels::PacketKernels(Context& context, const TraceOptions& options)
    : context_(context),
      form_(options.packet_form),
      shape_(packet_shape(context.device(), options)) {}

BuildOptions PacketKernels::build(int lens_kind) const {
  BuildOptions build;
  build.define("LANES", shape_.grouped ? 1 : shape_.lanes)
      .define("TILE", shape_.tile)
      .define("CHUNK", HitStreams::kChunkRows)
      .define("LENS", lens_kind);
  if (shape_.grouped) build.define("GROUP", shape_.lanes);
  return build;
}

Kernel PacketKernels::forward(const BuildOptions& build) {
  if (shape_.grouped) return group_kernel("trace/group_forward.cl", "trace_forward_group", build);
  BuildOptions own = build;
  own.define("BLOCK", shape_.block).define("PENDING", shape_.pending);
  return context_.kernel("trace/camera_forward.cl", "trace_forward", own);
}

Kernel PacketKernels::backward(const BuildOptions& build) {
  if (shape_.grouped) return group_kernel("trace/group_backward.cl", "trace_backward_group", build);
  return context_.kernel("trace/camera_backward.cl", "trace_backward", build);
}

// A kernel of a group's packet, with subgroups where the packet has them. Only the compiled kernel
// tells how large they are; a kernel whose work-groups are several of them is built again without.
Kernel PacketKernels::group_kernel(const char* file, const char* name, const BuildOptions& build) {
  if (!shape_.subgroups) return context_.kernel(file, name, build);
  BuildOptions one = build;
  one.define("SUBGROUP", shape_.sized ? 2 : 1)
      .language(context_.device().version.starts_with("OpenCL 3.") ? "CL3.0" : "CL2.0");
  Kernel kernel = context_.kernel(file, name, one);
  const std::size_t number = kernel.subgroups(items());
  if (number == 1) return kernel;
  if (form_ == PacketForm::kSubgroup) {
    throw DeviceError(fmt::format(
        "{} makes {} subgroups of a packet of {} rays in kernel {}, which has to be one: choose "
        "another --packet-width, or --packet-shape group",
        context_.device().name, number, shape_.lanes, name));
  }
  shape_.subgroups = false;
  return context_.kernel(file, name, build);
}

Range PacketKernels::range(const Kernel& kernel,
                           int block,
                           int width,
                           const TileRows& tiles) const {
  PacketShape item = shape_;
  item.width *= block;
  item.height *= block;
  const auto tile = static_cast<std::size_t>(item.tile / item.height);
  const std::size_t across =
      std::min(tiles.columns * static_cast<std::size_t>(item.tile / item.width),
               static_cast<std::size_t>((width + item.width - 1) / item.width));
  Range range;
  if (shape_.grouped) {
    range = {{across * items(), tiles.rows * tile, 1}, {items(), 1, 1}, {}};
  } else {
    const auto group = packet_group(item, kernel.max_work_group_size());
    range = Range::plane(across, tiles.rows * tile, group[0], group[1]);
  }
  range.offset[1] = tiles.row * tile;
  return range;
}

}  // namespace raysplats
