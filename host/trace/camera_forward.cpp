// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <utility>

#include "device/fault_injection.hpp"
#include "scene/options/trace_option_table.hpp"
#include "trace/camera_rays.hpp"
#include "trace/camera_tracer_impl.hpp"

namespace raysplats {

bool CameraTracer::Impl::can_trace_ahead() const {
  const auto across = [this](int pixels) {
    return static_cast<std::size_t>((pixels + packet().tile - 1) / packet().tile);
  };
  return traced_whole && lists.can_build_ahead(across(camera.width) * across(camera.height));
}

// Traces with the room that there is, without asking the device whether it is enough.
void CameraTracer::Impl::trace_ahead(const DeviceGaussians& gaussians) {
  FaultInjection& faults = context.faults();
  room = faults.strikes(Fault::kHits) ? 0 : static_cast<std::uint32_t>(streams.view_room());
  const std::size_t budget = faults.strikes(Fault::kLists) ? 0 : shares.tile_lists();
  bool anew = true;
  for (const int number : faces()) {
    set_face(gaussians, number);
    lists.build_ahead(boxes, camera, whole(), budget, std::exchange(anew, false), counters,
                      overflow);
    launch_forward(whole(), true);
  }
  streams.check(packet_count(), room, counters, overflow);
  hits_complete = true;
}

// Lines and outlines of all Gaussians as the face sees them.
void CameraTracer::Impl::set_face(const DeviceGaussians& gaussians, int number) {
  face = number;
  camera = device_camera(view, options, number);
  lists.prepare(gaussians, camera,
                {lens_kind, number, lens_kind != RS_LENS_PINHOLE ? &lens : nullptr}, options);
}

void CameraTracer::Impl::trace_faces(const DeviceGaussians& gaussians, bool keep) {
  room = static_cast<std::uint32_t>(keep ? streams.view_room() : 0);
  for (const int number : faces()) {
    set_face(gaussians, number);
    const TileWindow window = keep ? whole() : share();
    if (window.rows > 0) trace_window(gaussians, window, keep);
  }
}

// Traces rows of tiles with the whole pool of chunks.
void CameraTracer::Impl::trace_tile_rows(const DeviceGaussians& gaussians,
                                         std::uint32_t row,
                                         std::uint32_t rows) {
  room = static_cast<std::uint32_t>(streams.capacity());
  trace_window(gaussians, tile_window(row, rows), true);
}

// Splits the window until the candidate lists of each part fit their share of the budget.
void CameraTracer::Impl::trace_window(const DeviceGaussians& gaussians,
                                      const TileWindow& window,
                                      bool keep) {
  if (!lists.build(boxes, camera, window, shares.tile_lists(), counters)) {
    if (keep) traced_whole = false;
    for (const TileWindow& half : window.halves()) trace_window(gaussians, half, keep);
    return;
  }
  launch_forward(window, keep);
}

std::vector<Kernel>& CameraTracer::Impl::forward_pass(int lens, bool keep) {
  const int variant =
      (options.depth ? 1 : 0) | (options.hit_order == HitOrder::kPeak ? 2 : 0) | lens << 2;
  if (variant != forward_variant) {
    forward_variant = variant;
    forward_kernels = {};
  }
  std::vector<Kernel>& pass = forward_kernels[keep ? 1 : 0];
  if (pass.empty()) {
    BuildOptions build = kernels.build(lens);
    build.define("PEAK_ORDER", options.hit_order == HitOrder::kPeak ? 1 : 0)
        .define("WITH_DEPTH", options.depth ? 1 : 0)
        .define("KEEP_HITS", keep ? 1 : 0);
    if (counters.size() > RS_COUNT_WORDS) build.define("COUNT_WORK", 1);
    pass = kernels.forward(build);
  }
  return pass;
}

void CameraTracer::Impl::launch_forward(const TileWindow& window, bool keep) {
  std::vector<Kernel>& launched = forward_pass(lens_kind, keep);
  const auto rows = static_cast<std::uint32_t>(window.rows);
  const auto columns = static_cast<std::uint32_t>(window.columns);
  LaunchBudget& budget = watch && !forward_budget.bounded() ? watched_budget : forward_budget;
  const double all = static_cast<double>(lists.tiles_x()) * lists.tile_rows() *
                     static_cast<double>(std::size(faces()));
  RsForward pass{};
  pass.window[0] = window.column;
  pass.window[1] = window.row;
  pass.window[2] = window.columns;
  pass.window[3] = window.rows;
  std::copy(options.background.begin(), options.background.end(), pass.background);
  pass.min_transmittance = stopping_transmittance(options);
  pass.max_hits = options.max_hits;
  pass.pool_capacity = keep ? room : 0;
  in_bands(context, budget, rows, [&](std::uint32_t first, std::uint32_t number) {
    for (Kernel& kernel : launched) {
      kernel.launch(kernels.range(kernel, packet().block, camera.width, {columns, first, number}),
                    lists.arguments(), view_arguments(), pass, streams.arguments(), image, depth,
                    counters);
    }
    if (!watch) return;
    context.finish();
    watched_tiles += std::size_t{number} * columns;
    watch(std::min(1.0, static_cast<double>(watched_tiles) / all));
  });
}

}  // namespace raysplats
