// SPDX-License-Identifier: Apache-2.0
#include "trace/camera_tracer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "bvh/gaussian_bounds.hpp"
#include "raysplats/error.hpp"
#include "scene/camera/camera_check.hpp"
#include "scene/image/planes.hpp"
#include "scene/options/trace_option_table.hpp"
#include "trace/camera_rays.hpp"
#include "trace/camera_tracer_impl.hpp"

namespace raysplats {
namespace {

const std::vector<int> kFront{0};

// Groups of the first launch by segments, none of which has many rows: a view of 400 x 400 pixels,
// say, takes one launch from the start. Who asks for a time of launches may ask for little.
constexpr std::uint32_t kFirstSegments = 8192;

LaunchBudget segment_budget(const TraceOptions& options, const DeviceInfo& device) {
  const bool own = options.launch_budget_ms > 0;
  return {options.launch_budget_ms, device.type, own ? LaunchBudget::kFirstRows : kFirstSegments};
}

TraceOptions checked(const TraceOptions& options) {
  check_trace_options(options);
  return options;
}

}  // namespace

CameraTracer::Impl::Impl(Context& context_in, const TraceOptions& options_in)
    : context(context_in),
      options(checked(options_in)),
      shares(options_in, context_in.device()),
      kernels(context_in, options_in),
      lists(context_in, packet().tile),
      lens(context_in, packet().tile),
      no_tiles(context_in, 1, "no tiles of a lens"),
      no_tangents(context_in, 1, "no tangents of a lens"),
      no_depth_gradient(context_in, 1, "no depth gradient"),
      forward_budget(options_in.launch_budget_ms, context_in.device().type),
      backward_budgets{LaunchBudget(options_in.launch_budget_ms, context_in.device().type),
                       LaunchBudget(options_in.launch_budget_ms, context_in.device().type)},
      segment_budgets{segment_budget(options_in, context_in.device()),
                      segment_budget(options_in, context_in.device()),
                      segment_budget(options_in, context_in.device())},
      watched_budget(LaunchBudget::kWatched, context_in.device().type),
      segments(context_in, packet().lanes),
      streams(context_in,
              packet().lanes,
              packet().grouped ? StreamSegments::chunk_bytes(packet().lanes) : 0,
              shares.hit_streams()),
      counters(context_in, RS_COUNT_WORDS, "trace counters"),
      overflow(context_in, 1, "overflow of a view"),
      sums(context_in, "line gradients") {
  overflow.clear();
}

const std::vector<int>& CameraTracer::Impl::faces() const {
  return lens_kind != RS_LENS_PINHOLE ? lens.faces() : kFront;
}

CameraTracer::Statistics CameraTracer::Impl::count_statistics() const {
  const std::vector<std::uint32_t> words = counters.download();
  const auto wide = [&](std::size_t low) {
    return std::uint64_t{words[low + 1]} << 32 | words[low];
  };
  return {words[RS_COUNT_CAPPED], wide(RS_COUNT_CANDIDATES), wide(RS_COUNT_HITS),
          words[RS_COUNT_CHUNKS] * streams.chunk_bytes()};
}

// Chunks that the pass just enqueued wants, whose statistics stay: waits for the device.
std::size_t CameraTracer::Impl::chunks_wanted() {
  saved = count_statistics();
  statistics_saved = true;
  return saved.stream_bytes / streams.chunk_bytes();
}

// Begins the programs of one face.
void CameraTracer::Impl::begin_programs(const DeviceGaussians& gaussians,
                                        int lens,
                                        bool keep,
                                        bool with_depth) {
  const int variant = (keep ? 1 : 0) | (with_depth ? 1 << 10 : 0) |
                      (gaussians.activation == ScaleActivation::kSigmoid ? 2 : 0) |
                      (options.hit_order == HitOrder::kPeak ? 4 : 0) |
                      gaussians.active_sh_degree << 3 | gaussians.sh_degree << 5 | lens << 7;
  if (variant == begun_variant) return;
  begun_variant = variant;
  lists.begin_programs(gaussians, lens, options);
  forward_pass(lens, keep);
  if (!keep) return;
  const GradientSumChoice choice = sum_choice(gaussians.count);
  backward_pass(lens, choice, with_depth);
  if (cuts_streams(choice)) segment_pass(lens, with_depth);
  finalize_kernel(gaussians, lens, with_depth, false, false);
}

CameraTracer::CameraTracer(Context& context, const TraceOptions& options)
    : impl_(std::make_unique<Impl>(context, options)) {}
CameraTracer::~CameraTracer() = default;

void CameraTracer::set_watch(std::function<void(double)> watch) { impl_->watch = std::move(watch); }

const Buffer<float>& CameraTracer::image() const { return impl_->image; }
const Buffer<float>& CameraTracer::depth() const { return impl_->depth; }

void CameraTracer::set_background(const std::array<float, 3>& background) {
  impl_->options.background = background;
}

void CameraTracer::begin_programs(const DeviceGaussians& gaussians,
                                  const Camera& camera,
                                  bool keep_hits,
                                  bool depth_gradient) {
  impl_->begin_programs(gaussians, lens_kind(camera), keep_hits, depth_gradient);
}

void CameraTracer::update(const DeviceGaussians& gaussians) {
  Impl& self = *impl_;
  self.revision = 0;  // where this throws, the boxes are of no model
  GaussianBounds bounds(self.context, gaussians.activation == ScaleActivation::kSigmoid,
                        self.options.adaptive_radius);
  bounds.compute(gaussians.means, gaussians.quaternions, gaussians.scales, gaussians.opacities,
                 gaussians.count, self.options.quantile, self.boxes);
  // Another model may fit.
  if (self.count != gaussians.count) self.traced_whole = self.streams.capacity() > 0;
  self.count = gaussians.count;
  self.revision = gaussians.revision;
}

void CameraTracer::set_share(std::size_t part, std::size_t parts) {
  impl_->part = part;
  impl_->parts = parts;
}

std::array<int, 2> CameraTracer::rows() const {
  const Impl& self = *impl_;
  return self.hits_kept ? std::array<int, 2>{0, self.camera.height}
                        : shared_rows(self.camera.height);
}

std::array<int, 2> CameraTracer::shared_rows(int height) const {
  const Impl& self = *impl_;
  const auto [first, last] = self.tile_share(height);
  const int tile = self.packet().tile;
  return {std::min(first * tile, height), std::min(last * tile, height)};
}

const Buffer<std::uint32_t>& CameraTracer::overflow() const { return impl_->overflow; }
void CameraTracer::clear_overflow() { impl_->overflow.clear(); }
const Buffer<std::uint32_t>& CameraTracer::counters() const { return impl_->counters; }

void CameraTracer::count_work() {
  impl_->counters.ensure(impl_->context, RS_COUNT_WORDS + 2 * RS_TALLIES, "counted work");
  impl_->forward_variant = -1;  // other kernels
}

std::vector<std::uint64_t> CameraTracer::work() const {
  const std::vector<std::uint32_t> words = impl_->counters.download();
  std::vector<std::uint64_t> out;
  for (std::size_t i = RS_COUNT_WORDS; i + 1 < words.size(); i += 2)
    out.push_back(std::uint64_t{words[i + 1]} << 32 | words[i]);
  return out;
}

void CameraTracer::forward(const DeviceGaussians& gaussians,
                           const Camera& camera,
                           bool keep_hits,
                           ViewSizes sizes) {
  Impl& self = *impl_;
  require_pixels(camera);
  if (self.count != gaussians.count || self.revision != gaussians.revision) {
    throw UsageError("CameraTracer::update() must follow every change of the Gaussians");
  }
  self.camera = device_camera(camera, self.options);
  if (!traces(camera)) {
    throw UsageError(
        fmt::format("The camera '{}' sees too much in a tile of {} pixels for packets of rays: "
                    "trace its rays one by one, traversal auto or bvh",
                    camera.name, self.packet().tile));
  }
  self.view = camera;
  self.lens_kind = lens_kind(camera);
  self.begin_programs(gaussians, self.lens_kind, keep_hits, self.depth_gradient != nullptr);
  self.image.ensure(self.context, 4 * self.pixels(), "image");
  self.depth.ensure(self.context, self.options.depth ? 3 * self.pixels() : 1, "depth");
  self.streams.prepare(self.pixels(), self.packet_count(), keep_hits);
  self.hits_kept = keep_hits;
  self.statistics_saved = false;
  self.watched_tiles = 0;
  if (keep_hits && sizes == ViewSizes::kAhead && self.can_trace_ahead()) {
    self.trace_ahead(gaussians);
    return;
  }
  self.counters.clear();
  if (self.streams.capacity() == 0) self.streams.grow(keep_hits ? 2 * self.packet_count() : 1);
  if (keep_hits) self.traced_whole = true;
  self.trace_faces(gaussians, keep_hits);
  if (!keep_hits) return;
  const std::size_t wanted = self.chunks_wanted();
  self.hits_complete = wanted <= self.streams.view_room();
  if (self.hits_complete) return;
  self.streams.grow(wanted);
  if (wanted > self.streams.limit()) {  // backward() traces again, band by band
    self.traced_whole = false;
    return;
  }
  self.counters.clear();
  self.trace_faces(gaussians, true);
  self.hits_complete = self.chunks_wanted() <= self.streams.view_room();
}

bool CameraTracer::traces(const Camera& camera) {
  if (camera.model == CameraModel::kOrthographic) return false;
  require_pixels(camera);
  return lens_kind(camera) == RS_LENS_PINHOLE || impl_->lens.prepare(camera);
}

CameraTracer::Statistics CameraTracer::statistics() const {
  return impl_->statistics_saved ? impl_->saved : impl_->count_statistics();
}

Image CameraTracer::download_image() const {
  return interleaved(impl_->image.download(), impl_->camera.width, impl_->camera.height, 4);
}

Image CameraTracer::download_depth() const {
  if (!impl_->options.depth) throw UsageError("Depth was not traced: set TraceOptions::depth");
  return interleaved(impl_->depth.download(), impl_->camera.width, impl_->camera.height, 3);
}

}  // namespace raysplats
