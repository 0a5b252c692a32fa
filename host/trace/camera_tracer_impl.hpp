// SPDX-License-Identifier: Apache-2.0
// What the parts of CameraTracer share: the tracer itself in camera_tracer.cpp, its passes in
// camera_forward.cpp and camera_backward.cpp.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <vector>

#include "scene/image/pixel_count.hpp"
#include "scene/image/row_share.hpp"
#include "trace/camera_tracer.hpp"
#include "trace/candidate_lists.hpp"
#include "trace/gaussian_kernel.hpp"
#include "trace/gradient_sums.hpp"
#include "trace/hit_streams.hpp"
#include "trace/launch_budget.hpp"
#include "trace/lens_tiles.hpp"
#include "trace/memory_shares.hpp"
#include "trace/packet_kernels.hpp"
#include "trace/stream_segments.hpp"
#include "trace/view_sizes.h"

namespace raysplats {

struct CameraTracer::Impl {
  Impl(Context& context_in, const TraceOptions& options_in);

  void begin_programs(const DeviceGaussians& gaussians, int lens, bool keep_hits, bool with_depth);

  // camera_forward.cpp: the faces of a view, from lists to hits.
  void set_face(const DeviceGaussians& gaussians, int face);
  void trace_faces(const DeviceGaussians& gaussians, bool keep);
  bool can_trace_ahead() const;
  void trace_ahead(const DeviceGaussians& gaussians);
  void trace_tile_rows(const DeviceGaussians& gaussians, std::uint32_t row, std::uint32_t rows);
  void trace_window(const DeviceGaussians& gaussians, const TileWindow& window, bool keep);
  void launch_forward(const TileWindow& window, bool keep);
  std::vector<Kernel>& forward_pass(int lens, bool keep);

  // camera_backward.cpp: from hits to gradients of lines, and from those to parameters.
  void backward_face(const DeviceGaussians& gaussians, const Buffer<float>& image_gradient);
  void backward_tile_rows(const DeviceGaussians& gaussians,
                          const Buffer<float>& image_gradient,
                          std::uint32_t row,
                          std::uint32_t rows);
  std::vector<Kernel> backward_pass(int lens, const GradientSumChoice& choice, bool with_depth);
  GaussianKernel finalize_kernel(
      const DeviceGaussians& gaussians, int lens, bool with_depth, bool accumulate, bool pose);
  GradientSumChoice sum_choice(std::size_t gaussians) const {
    return GradientSumChoice::of(options, context.device(), gaussians, shares.packet_gradients(),
                                 GradientSumChoice::kPacketCopies);
  }
  void launch_backward(const Buffer<float>& image_gradient, std::uint32_t row, std::uint32_t rows);
  void cut_streams(const Buffer<float>& image_gradient, const RsBackward& pass);
  bool cuts_streams(const GradientSumChoice& choice) const {
    return packet().grouped && choice.sum != GradientSum::kCopies;
  }
  std::array<Kernel, 2> segment_pass(int lens, bool with_depth);
  void finalize(const DeviceGaussians& gaussians,
                GaussianGradients& gradients,
                bool accumulate,
                bool pose);
  void add_pose(const DeviceGaussians& gaussians, PoseGradient& sum);

  Statistics count_statistics() const;
  std::size_t chunks_wanted();

  TileWindow whole() const { return tile_window(0, lists.tile_rows()); }
  // The rows of tiles of set_share().
  std::array<int, 2> tile_share(int height) const {
    return share_of_rows((height + packet().tile - 1) / packet().tile, part, parts);
  }
  TileWindow share() const {
    const auto [first, last] = tile_share(camera.height);
    return tile_window(static_cast<std::uint32_t>(first), static_cast<std::uint32_t>(last - first));
  }
  TileWindow tile_window(std::uint32_t row, std::uint32_t rows) const {
    return {0, static_cast<std::int32_t>(row), static_cast<std::int32_t>(lists.tiles_x()),
            static_cast<std::int32_t>(rows)};
  }
  const std::vector<int>& faces() const;
  const PacketLayout& packet() const { return kernels.layout(); }
  // RS_VIEW_ARGUMENTS of cl/trace/arguments.h.
  auto view_arguments() const {
    const bool bent = lens_kind != RS_LENS_PINHOLE;
    return argument_pack(camera, face, bent ? lens.tiles() : no_tiles,
                         bent ? lens.tangents() : no_tangents);
  }
  const Buffer<float>& depth_slopes() const {
    return depth_gradient != nullptr ? *depth_gradient : no_depth_gradient;
  }
  float screen_x() const { return static_cast<float>(camera.width) / (2.0f * camera.fx); }
  float screen_y() const { return static_cast<float>(camera.height) / (2.0f * camera.fy); }
  std::size_t pixels() const { return pixel_count(camera.width, camera.height); }
  std::size_t packet_count() const {
    return static_cast<std::size_t>((camera.width + packet().width - 1) / packet().width) *
           static_cast<std::size_t>((camera.height + packet().height - 1) / packet().height);
  }

  Context& context;
  TraceOptions options;
  MemoryShares shares;
  PacketKernels kernels;
  int begun_variant = -1;      // of the last begin_programs()
  std::size_t count = 0;       // Gaussians of the last update()
  std::uint64_t revision = 0;  // of their parameters
  Buffer<RsAabb> boxes;
  CandidateLists lists;
  LensTiles lens;
  Buffer<RsLensTile> no_tiles;  // what kernels take for pinholes
  Buffer<float> no_tangents;
  Buffer<float> no_depth_gradient;
  LaunchBudget forward_budget;
  std::array<LaunchBudget, 2> backward_budgets;  // of the first launch and of the second
  std::array<LaunchBudget, 3> segment_budgets;   // of sums, and of both launches by segments
  LaunchBudget watched_budget;  // of launches that somebody watches, where no other bounds them
  std::function<void(double)> watch;
  std::size_t watched_tiles = 0;  // of this forward() that are done
  Camera view;                    // of the last forward()
  int lens_kind = RS_LENS_PINHOLE;
  int face = 0;
  RsCamera camera{};                                   // of the face that is being traced
  std::array<std::vector<Kernel>, 2> forward_kernels;  // without and with kept hits
  int forward_variant = -1;
  Buffer<float> image;
  Buffer<float> depth;
  StreamSegments segments;
  HitStreams streams;
  Buffer<std::uint32_t> counters;  // trace/view_sizes.h
  Buffer<std::uint32_t> overflow;
  std::uint32_t room = 0;     // chunks of the pool that launches may use
  bool traced_whole = false;  // the last view that was waited for fits the memory budget
  Statistics saved;
  bool statistics_saved = false;
  std::size_t part = 0, parts = 1;  // set_share()
  bool hits_kept = false;           // the last forward() was asked to keep hits
  bool hits_complete = false;       // and all of them fit
  GradientSums sums;
  const Buffer<float>* depth_gradient = nullptr;  // of this backward()
  Buffer<float> pose;
  GaussianGradients pose_scratch;
};

}  // namespace raysplats
