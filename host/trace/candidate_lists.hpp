// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "parallel/radix_sort.hpp"
#include "parallel/scan.hpp"
#include "raysplats/camera.hpp"
#include "raysplats/trace_options.hpp"
#include "shared/layout.h"
#include "trace/device_gaussians.hpp"
#include "trace/gaussian_kernel.hpp"
#include "trace/lens_tiles.hpp"

namespace raysplats {

/// The record of a pinhole, or of one face of another central camera, that kernels read. Throws
/// UsageError for orthographic cameras, whose rays share no origin.
RsCamera device_camera(const Camera& camera, const TraceOptions& options, int face = 0);

/// What the build constant LENS (RS_LENS_PINHOLE and others) is for a camera.
int lens_kind(const Camera& camera);

/// A rectangle of tiles, as kernels take it.
struct TileWindow {
  std::int32_t column = 0;  ///< of the first tile
  std::int32_t row = 0;
  std::int32_t columns = 0;
  std::int32_t rows = 0;

  std::size_t tiles() const {
    return static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows);
  }
  /// The window in two parts: of its rows, or where it has one of its columns. It must have more
  /// than one tile.
  std::array<TileWindow, 2> halves() const;
};

/// Which pinhole the lists of a view are for.
struct ViewFace {
  int lens = RS_LENS_PINHOLE;  ///< lens_kind()
  int face = 0;
  const LensTiles* tiles = nullptr;  ///< of a lens
};

/// What the tiles of one view may hit: the line of every visible Gaussian and, per tile, the list
/// of candidates whose outline meets the tile, sorted by a lower bound of the hit depth.
class CandidateLists {
 public:
  /// Key and value, box, limits, and two pairs of the sort.
  static constexpr std::size_t kBytesPerCandidate = 2 * 4 + 4 * 4 + 8 + 2 * 8;

  /// Candidates that there is room for once a view had so many.
  static constexpr std::size_t with_headroom(std::size_t count) { return count + count / 4 + 1024; }

  CandidateLists(Context& context, int tile_size);

  /// Begins to make the programs of views through this kind of lens; prepare() does it as well.
  void begin_programs(const DeviceGaussians& gaussians, int lens, const TraceOptions& options);

  /// Lines and culling records of all Gaussians for a view.
  void prepare(const DeviceGaussians& gaussians,
               const RsCamera& camera,
               const ViewFace& face,
               const TraceOptions& options);

  /// Lists of the tiles of a window; waits for the device to tell how many candidates there are,
  /// and adds them to `counters` (trace/view_sizes.h). `boxes` are the world boxes of the
  /// confidence ellipsoids, for those that the camera plane cuts. Returns false, having made
  /// nothing, when there is more than one tile and they would take more than `budget` bytes or are
  /// more than can be numbered.
  bool build(const Buffer<RsAabb>& boxes,
             const RsCamera& camera,
             const TileWindow& window,
             std::size_t budget,
             Buffer<std::uint32_t>& counters);
  /// The same without waiting: where there are more candidates than the lists before had room for,
  /// or the budget allows, the lists are empty and overflow[0] becomes 1. With `anew` all counters
  /// begin at zero.
  void build_ahead(const Buffer<RsAabb>& boxes,
                   const RsCamera& camera,
                   const TileWindow& window,
                   std::size_t budget,
                   bool anew,
                   Buffer<std::uint32_t>& counters,
                   Buffer<std::uint32_t>& overflow);
  /// Whether build_ahead() has any room, and numbers for so many tiles.
  bool can_build_ahead(std::size_t tiles) const;

  std::uint32_t tiles_x() const { return tiles_x_; }
  std::uint32_t tile_rows() const { return tile_rows_; }

  const Buffer<RsLine>& lines() const { return lines_; }
  const Buffer<RsViewBounds>& bounds() const { return bounds_; }
  /// RS_LIST_ARGUMENTS of cl/trace/arguments.h.
  auto arguments() const {
    return argument_pack(lines_, values_, boxes_, stride_, limits_, tile_offsets_);
  }

 private:
  std::size_t allowed(std::size_t budget) const;
  void count(const Buffer<RsAabb>& boxes, const RsCamera& camera, const TileWindow& window);
  void fill(const Buffer<RsAabb>& boxes,
            const RsCamera& camera,
            const TileWindow& window,
            std::size_t capacity,
            std::size_t room,
            bool anew,
            Buffer<std::uint32_t>& counters,
            Buffer<std::uint32_t>& overflow);

  Context* context_;
  int tile_size_;
  GaussianKernel prepare_kernel_;
  int prepared_variant_ = -1;
  ViewFace face_;  // of the last prepare()
  GaussianKernel count_kernel_;
  GaussianKernel fill_kernel_;
  Kernel gather_kernel_;
  Kernel admit_kernel_;
  RadixSort sort_;
  Scan scan_;
  std::size_t count_ = 0;
  std::uint32_t tiles_x_ = 1;
  std::uint32_t tile_rows_ = 1;
  std::uint32_t stride_ = 0;
  std::size_t capacity_ = 0;  // candidates that the lists have room for
  Buffer<RsLine> lines_;
  Buffer<RsViewBounds> bounds_;
  Buffer<std::uint32_t> live_;     // candidates that are listed, first step of their depths
  Buffer<std::uint32_t> fitted_;   // an overflow that cannot be
  Buffer<std::uint32_t> offsets_;  // first candidate per Gaussian
  Buffer<std::uint32_t> tile_offsets_;
  Buffer<std::uint32_t> keys_;
  Buffer<std::uint32_t> values_;
  Buffer<float> boxes_;
  Buffer<std::array<float, 2>> limits_;
};

}  // namespace raysplats
