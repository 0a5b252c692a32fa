// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <bit>

#include "bench/scene_state.hpp"
#include "trace/packet_layout.hpp"
#include "trace/view_sizes.h"

namespace raysplats {
namespace {

constexpr std::size_t kWave = 32;
constexpr int kVectorLanes = 16;
constexpr int kGroupTile = 16;

// The tiles that each form has by default on its own kind of device.
class Tuned {
 public:
  Tuned(Context& context, bool grouped) : context_(context), before_(context.device().tuning) {
    std::optional<DeviceTuning> tuning;
    if (grouped)
      tuning = {.grouped = true, .packet_width = static_cast<int>(kWave), .tile = kGroupTile};
    context_.set_tuning(tuning);
  }
  ~Tuned() { context_.set_tuning(before_); }
  Tuned(const Tuned&) = delete;
  Tuned& operator=(const Tuned&) = delete;

 private:
  Context& context_;
  std::optional<DeviceTuning> before_;
};

void count_view(CameraTracer& tracer,
                const DeviceGaussians& gaussians,
                const Camera& camera,
                ExecutedCounts& out) {
  tracer.count_work();
  tracer.update(gaussians);
  tracer.forward(gaussians, camera, true);
  const CameraTracer::Statistics statistics = tracer.statistics();
  out.candidates = static_cast<double>(statistics.candidates);
  out.hits = static_cast<double>(statistics.hits);
  out.stream_bytes = static_cast<double>(statistics.stream_bytes);
  const std::vector<std::uint64_t> work = tracer.work();
  const auto of = [&work](std::size_t kind) { return static_cast<double>(work[kind]); };
  out.boxes = of(RS_TALLY_BOXES);
  out.tested = of(RS_TALLY_TESTED);
  out.found = of(RS_TALLY_FOUND);
  out.opened = of(RS_TALLY_OPENED);
  out.compared = of(RS_TALLY_COMPARED);
  out.rounds = of(RS_TALLY_ROUNDS);
  out.ordered = of(RS_TALLY_ORDERED);
  out.windows = of(RS_TALLY_WINDOWS);
}

// Rays of a wave walk together: the longest way counts for all.
void count_rays(const std::vector<RayResult>& results, ExecutedCounts& out) {
  out.rays = static_cast<double>(results.size());
  const std::size_t together = out.grouped ? kWave : 1;
  for (std::size_t first = 0; first < results.size(); first += together) {
    const std::size_t last = std::min(first + together, results.size());
    float nodes = 0, blocks = 0;
    std::uint32_t hits = 0;
    for (std::size_t i = first; i < last; ++i) {
      nodes = std::max(nodes, results[i].expected_depth);
      blocks = std::max(blocks, results[i].median_depth);
      hits = std::max(hits, results[i].hits);
    }
    const auto rays = static_cast<double>(last - first);
    out.ray_nodes += rays * static_cast<double>(nodes);
    out.ray_blocks += rays * static_cast<double>(blocks);
    out.ray_hits += rays * hits;
  }
}

}  // namespace

ExecutedCounts SceneBench::counts(bool grouped) {
  Impl& self = *impl_;
  TraceOptions trace = self.options.trace;
  trace.packet_shape = grouped ? PacketShape::kGroup : PacketShape::kVector;
  trace.packet_width = grouped ? static_cast<int>(kWave) : kVectorLanes;
  const Tuned tuned(self.context, grouped);
  ExecutedCounts out;
  out.grouped = grouped;
  out.gaussians = self.gaussians_count();
  out.sh = self.sh_count();
  out.pixels = self.pixels();
  out.peak_order = trace.hit_order == HitOrder::kPeak;
  const PacketLayout layout = packet_layout(self.context.device(), trace);
  const auto across = [&](int size, int part) { return (size + part - 1) / part; };
  const Camera& camera = self.model.camera;
  const int packets = across(camera.width, layout.width) * across(camera.height, layout.height);
  out.packets = packets;
  const auto tiles =
      static_cast<unsigned>(across(camera.width, layout.tile) * across(camera.height, layout.tile));
  const int sort_passes = (16 + static_cast<int>(std::bit_width(tiles - 1)) + 7) / 8;
  out.sort_passes = sort_passes;
  CameraTracer tracer(self.context, trace);
  count_view(tracer, self.gaussians(), camera, out);
  DeviceInfo device = self.context.device();
  if (grouped) device.type = DeviceType::kGpu;
  RayTracer rays(self.context, of_bare_rays(trace), tree_form(device));
  rays.count_work();
  rays.update(self.gaussians());
  self.make_rays();
  count_rays(rays.trace(self.gaussians(), self.ray_list), out);
  return out;
}

}  // namespace raysplats
