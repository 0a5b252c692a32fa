// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "device/build_options.hpp"
#include "device/context.hpp"
#include "device/kernel.hpp"
#include "raysplats/trace_options.hpp"
#include "trace/packet_layout.hpp"

namespace raysplats {

/// Rows [row, row + rows) of `columns` tiles of a picture.
struct TileRows {
  std::uint32_t columns = 0;
  std::uint32_t row = 0;
  std::uint32_t rows = 0;
};

/// Kernels that trace packets of rays: which there are, how they are built and over what they run.
class PacketKernels {
 public:
  PacketKernels(Context& context, const TraceOptions& options);

  const PacketLayout& layout() const { return layout_; }
  /// Work-items of a packet.
  std::size_t items() const {
    return layout_.grouped ? static_cast<std::size_t>(layout_.lanes) : 1;
  }

  /// What the kernels of both passes are built with, besides their own.
  BuildOptions build(int lens_kind) const;
  /// The kernels of a pass, in the order of their launches: trace_forward, or trace_forward_group
  /// and the same again for the packets that the first one has left, which need more room.
  std::vector<Kernel> forward(const BuildOptions& build);
  /// The same of trace_backward or trace_backward_group.
  std::vector<Kernel> backward(const BuildOptions& build);
  /// What cuts streams into segments before trace_backward_group: list_segments and sum_segments.
  std::array<Kernel, 2> segments(const BuildOptions& build);

  /// A work-item for every block x block packets of whole tiles, or a work-group for every packet
  /// of a picture that is `width` pixels wide.
  Range range(const Kernel& kernel, int block, int width, const TileRows& tiles) const;

 private:
  std::vector<Kernel> group_kernels(const char* file,
                                    const char* name,
                                    const BuildOptions& build,
                                    int crowded_rows);
  Kernel group_kernel(const char* file, const char* name, const BuildOptions& build);

  Context& context_;
  PacketShape shape_;
  PacketLayout layout_;
};

}  // namespace raysplats
