// SPDX-License-Identifier: Apache-2.0
#include "trace/packet_kernels.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "raysplats/error.hpp"
#include "trace/hit_streams.hpp"

namespace raysplats {

PacketKernels::PacketKernels(Context& context, const TraceOptions& options)
    : context_(context),
      shape_(options.packet_shape),
      layout_(packet_layout(context.device(), options)) {}

BuildOptions PacketKernels::build(int lens_kind) const {
  BuildOptions build;
  build.define("LANES", layout_.grouped ? 1 : layout_.lanes)
      .define("TILE", layout_.tile)
      .define("CHUNK", HitStreams::kChunkRows)
      .define("LENS", lens_kind);
  if (layout_.grouped) build.define("GROUP", layout_.lanes);
  return build;
}

std::vector<Kernel> PacketKernels::forward(const BuildOptions& build) {
  if (layout_.grouped) {
    return group_kernels("trace/group_forward.cl", "trace_forward_group", build,
                         layout_.crowded_rows[0]);
  }
  BuildOptions own = build;
  own.define("BLOCK", layout_.block)
      .define("PENDING", layout_.pending)
      .define("STRETCHES", layout_.stretches);
  return {context_.kernel("trace/camera_forward.cl", "trace_forward", own)};
}

std::vector<Kernel> PacketKernels::backward(const BuildOptions& build) {
  if (layout_.grouped) {
    return group_kernels("trace/group_backward.cl", "trace_backward_group", build,
                         layout_.crowded_rows[1]);
  }
  return {context_.kernel("trace/camera_backward.cl", "trace_backward", build)};
}

std::array<Kernel, 2> PacketKernels::segments(const BuildOptions& build) {
  constexpr char kProgram[] = "trace/stream_segments.cl";
  return {context_.kernel(kProgram, "list_segments", build),
          context_.kernel(kProgram, "sum_segments", build)};
}

std::vector<Kernel> PacketKernels::group_kernels(const char* file,
                                                 const char* name,
                                                 const BuildOptions& build,
                                                 int crowded_rows) {
  BuildOptions crowded = build;
  crowded.define("CROWDED", 1).define("OPEN_LOCAL", crowded_rows);
  return {group_kernel(file, name, build), group_kernel(file, name, crowded)};
}

// A kernel of a group's packet, with subgroups where the packet has them. Only the compiled kernel
// tells how large they are; a kernel whose work-groups are several of them is built again without.
Kernel PacketKernels::group_kernel(const char* file, const char* name, const BuildOptions& build) {
  if (!layout_.subgroups) return context_.kernel(file, name, build);
  BuildOptions one = build;
  one.define("SUBGROUP", layout_.sized ? 2 : 1)
      .language(context_.device().version.starts_with("OpenCL 3.") ? "CL3.0" : "CL2.0");
  Kernel kernel = context_.kernel(file, name, one);
  const std::size_t number = kernel.subgroups(items());
  if (number == 1) return kernel;
  if (shape_ == PacketShape::kSubgroup) {
    throw DeviceError(fmt::format(
        "{} makes {} subgroups of a packet of {} rays in kernel {}, which has to be one: choose "
        "another --packet-width, or --packet-shape group",
        context_.device().name, number, layout_.lanes, name));
  }
  layout_.subgroups = false;
  return context_.kernel(file, name, build);
}

Range PacketKernels::range(const Kernel& kernel,
                           int block,
                           int width,
                           const TileRows& tiles) const {
  PacketLayout item = layout_;
  item.width *= block;
  item.height *= block;
  const auto tile = static_cast<std::size_t>(item.tile / item.height);
  const std::size_t across = tiles.columns * static_cast<std::size_t>(item.tile / item.width);
  Range range;
  if (layout_.grouped) {
    const std::size_t inside =
        std::min(across, static_cast<std::size_t>((width + item.width - 1) / item.width));
    range = {{inside * items(), tiles.rows * tile, 1}, {items(), 1, 1}, {}};
  } else {
    const auto group = packet_group(item, kernel.max_work_group_size());
    range = Range::plane(across, tiles.rows * tile, group[0], group[1]);
  }
  range.offset[1] = tiles.row * tile;
  return range;
}

}  // namespace raysplats
