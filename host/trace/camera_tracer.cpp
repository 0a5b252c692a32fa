// SPDX-License-Identifier: Apache-2.0
#include "trace/camera_tracer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <glm/matrix.hpp>
#include <limits>
#include <utility>

#include "bvh/gaussian_bounds.hpp"
#include "core/planes.hpp"
#include "device/fault_injection.hpp"
#include "raysplats/error.hpp"
#include "trace/camera_rays.hpp"
#include "trace/candidate_lists.hpp"
#include "trace/gaussian_kernel.hpp"
#include "trace/gradient_sums.hpp"
#include "trace/launch_budget.hpp"
#include "trace/memory_shares.hpp"
#include "trace/packet_shape.hpp"
#include "trace/view_sizes.h"

namespace raysplats {
namespace {

using Stream = std::array<std::uint32_t, 2>;

// Private copies of gradients per compute unit: more share the tiles out more evenly.
constexpr std::size_t kCopiesPerUnit = 2;
constexpr std::size_t kStreamGroup = 64;
constexpr std::uint32_t kChunkEntries =
    16;  // entries of a hit-stream chunk, the CHUNK of hit_stream.h

// Of launches whose picture somebody watches.
constexpr double kWatchedMilliseconds = 300.0;

const std::vector<int> kFront{0};

}  // namespace

struct CameraTracer::Impl {
  Impl(Context& context_in, const TraceOptions& options_in)
      : context(context_in),
        options(options_in),
        packet(packet_shape(context_in.device(), options_in)),
        lists(context_in, packet.tile),
        lens(context_in, packet.tile),
        no_tiles(context_in, 1, "no tiles of a lens"),
        no_tangents(context_in, 1, "no tangents of a lens"),
        no_depth_gradient(context_in, 1, "no depth gradient"),
        forward_budget(options_in.launch_budget_ms, context_in.device().type),
        backward_budget(options_in.launch_budget_ms, context_in.device().type),
        watched_budget(kWatchedMilliseconds, context_in.device().type),
        counters(context_in, RS_COUNT_WORDS, "trace counters"),
        overflow(context_in, 1, "overflow of a view"),
        sums(context_in, "line gradients") {
    overflow.clear();
    check_streams = context.kernel("trace/view_sizes.cl", "check_streams");
  }

  void set_face(const DeviceGaussians& gaussians, int face);
  void trace_faces(const DeviceGaussians& gaussians, bool keep);
  bool can_trace_ahead() const;
  void trace_ahead(const DeviceGaussians& gaussians);
  TileWindow whole() const { return tile_window(0, lists.tile_rows()); }
  // The rows of tiles of set_share().
  TileWindow share() const {
    const std::size_t first = tile_rows() * part / parts;
    return tile_window(static_cast<std::uint32_t>(first),
                       static_cast<std::uint32_t>(tile_rows() * (part + 1) / parts - first));
  }
  std::size_t tile_rows() const {
    return static_cast<std::size_t>((camera.height + packet.tile - 1) / packet.tile);
  }
  TileWindow tile_window(std::uint32_t row, std::uint32_t rows) const {
    return {0, static_cast<std::int32_t>(row), static_cast<std::int32_t>(lists.tiles_x()),
            static_cast<std::int32_t>(rows)};
  }
  const std::vector<int>& faces() const { return lens_kind > 0 ? lens.faces() : kFront; }
  const Buffer<RsLensTile>& tiles() const { return lens_kind > 0 ? lens.tiles() : no_tiles; }
  const Buffer<float>& tangents() const { return lens_kind > 0 ? lens.tangents() : no_tangents; }
  // RS_VIEW_ARGUMENTS and RS_STREAM_ARGUMENTS of cl/trace/arguments.h.
  auto view_arguments() const { return argument_pack(camera, face, tiles(), tangents()); }
  auto stream_arguments() const {
    return argument_pack(transmittances, stream_ends, pool, pool_transmittance);
  }
  void add_pose(const DeviceGaussians& gaussians, PoseGradient& sum);
  void backward_face(const DeviceGaussians& gaussians, const Buffer<float>& image_gradient);
  void trace_rows(const DeviceGaussians& gaussians, std::uint32_t row, std::uint32_t rows);
  void trace_window(const DeviceGaussians& gaussians, const TileWindow& window, bool keep);
  void launch_forward(const TileWindow& window, bool keep);
  void launch_backward(const Buffer<float>& image_gradient, std::uint32_t row, std::uint32_t rows);
  void backward_rows(const DeviceGaussians& gaussians,
                     const Buffer<float>& image_gradient,
                     std::uint32_t row,
                     std::uint32_t rows);
  void finalize(const DeviceGaussians& gaussians,
                GaussianGradients& gradients,
                bool accumulate,
                bool pose);
  Range packet_range(const Kernel& kernel,
                     int block,
                     std::uint32_t columns,
                     std::uint32_t row,
                     std::uint32_t rows) const;
  Statistics count_statistics() const;
  std::size_t chunks_wanted();
  void grow_pool(std::size_t chunks, std::size_t least = 1);
  Kernel& forward_kernel(bool keep);
  BuildOptions packet_build() const;
  Kernel group_kernel(const char* file, const char* name, const BuildOptions& build);
  // Work-items of a packet.
  std::size_t lane_items() const {
    return packet.grouped ? static_cast<std::size_t>(packet.lanes) : 1;
  }
  float screen_x() const { return static_cast<float>(camera.width) / (2.0f * camera.fx); }
  float screen_y() const { return static_cast<float>(camera.height) / (2.0f * camera.fy); }
  std::size_t pixels() const {
    return static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
  }
  std::size_t pool_capacity() const { return pool.size() / kChunkEntries; }
  // Of a whole view: a row of tiles that needed more than its share left the pool larger.
  std::size_t view_room() const { return std::min(pool_capacity(), pool_limit()); }
  std::size_t packet_count() const {
    return static_cast<std::size_t>((camera.width + packet.width - 1) / packet.width) *
           static_cast<std::size_t>((camera.height + packet.height - 1) / packet.height);
  }
  std::size_t row_bytes() const { return sizeof(float) * static_cast<std::size_t>(packet.lanes); }
  std::size_t chunk_bytes() const { return kChunkEntries * (sizeof(Stream) + row_bytes()); }
  // What the device and the 32-bit addresses of chunks allow.
  std::size_t largest_pool() const {
    return std::min<std::size_t>(
        context.device().max_allocation / (kChunkEntries * std::max(sizeof(Stream), row_bytes())),
        std::numeric_limits<std::uint32_t>::max() / kChunkEntries);
  }
  std::size_t pool_limit() const {
    return std::min(MemoryShares(options, context.device()).hit_streams() / chunk_bytes(),
                    largest_pool());
  }

  Context& context;
  TraceOptions options;
  PacketShape packet;
  std::size_t count = 0;       // Gaussians of the last update()
  std::uint64_t revision = 0;  // of their parameters
  Buffer<RsAabb> boxes;
  CandidateLists lists;
  LensTiles lens;
  Buffer<RsLensTile> no_tiles;  // what kernels take for pinholes
  Buffer<float> no_tangents;
  Buffer<float> no_depth_gradient;
  LaunchBudget forward_budget;
  LaunchBudget backward_budget;
  LaunchBudget watched_budget;  // of launches that somebody watches, where no other bounds them
  std::function<void(double)> watch;
  std::size_t watched_tiles = 0;  // of this forward() that are done
  Camera view;                    // of the last forward()
  int lens_kind = 0;
  int face = 0;
  RsCamera camera{};  // of the face that is being traced
  Kernel check_streams;
  std::array<Kernel, 2> forward_kernels;  // without and with kept hits
  int forward_variant = -1;
  Buffer<float> image;
  Buffer<float> depth;
  Buffer<float> transmittances;  // behind the last hit, before it
  Buffer<Stream> stream_ends;
  Buffer<Stream> pool;
  Buffer<float> pool_transmittance;
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

CameraTracer::CameraTracer(Context& context, const TraceOptions& options)
    : impl_(std::make_unique<Impl>(context, options)) {
  if (!(options.quantile > 0.0f) || !(options.min_transmittance >= 1e-6f) ||
      options.min_transmittance >= 1.0f || options.max_hits < 1) {
    throw UsageError(
        fmt::format("Trace options out of range: quantile {} must be positive, min-transmittance "
                    "{} in [1e-6, 1), max-hits {} at least 1",
                    options.quantile, options.min_transmittance, options.max_hits));
  }
}
CameraTracer::~CameraTracer() = default;

void CameraTracer::set_watch(std::function<void(double)> watch) { impl_->watch = std::move(watch); }

const Buffer<float>& CameraTracer::image() const { return impl_->image; }
const Buffer<float>& CameraTracer::depth() const { return impl_->depth; }
TraceOptions& CameraTracer::options() { return impl_->options; }

void CameraTracer::update(const DeviceGaussians& gaussians) {
  Impl& self = *impl_;
  GaussianBounds bounds(self.context, gaussians.activation == ScaleActivation::kSigmoid,
                        self.options.adaptive_radius);
  bounds.compute(gaussians.means, gaussians.quaternions, gaussians.scales, gaussians.opacities,
                 gaussians.count, self.options.quantile, self.boxes);
  // Another model may fit.
  if (self.count != gaussians.count) self.traced_whole = self.pool.size() > 0;
  self.count = gaussians.count;
  self.revision = gaussians.revision;
}

void CameraTracer::set_share(std::size_t part, std::size_t parts) {
  impl_->part = part;
  impl_->parts = parts;
}

std::array<int, 2> CameraTracer::rows() const {
  const Impl& self = *impl_;
  if (self.hits_kept) return {0, self.camera.height};
  const TileWindow window = self.share();
  const auto pixel_row = [&](std::int32_t row) {
    return std::min(row * self.packet.tile, static_cast<int>(self.camera.height));
  };
  return {pixel_row(window.row), pixel_row(window.row + window.rows)};
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
  self.camera = device_camera(camera, self.options.near_depth);
  if (!traces(camera)) {
    throw UsageError(
        fmt::format("The camera '{}' sees too much in a tile of {} pixels for packets of rays: "
                    "trace its rays one by one, traversal auto or bvh",
                    camera.name, self.packet.tile));
  }
  self.view = camera;
  self.lens_kind = lens_kind(camera);
  self.image.ensure(self.context, 4 * self.pixels(), "image");
  self.depth.ensure(self.context, self.options.depth ? 3 * self.pixels() : 1, "depth");
  self.transmittances.ensure(self.context, keep_hits ? 2 * self.pixels() : 1, "transmittances");
  self.stream_ends.ensure(self.context, keep_hits ? self.packet_count() : 1, "hit streams");
  self.hits_kept = keep_hits;
  self.statistics_saved = false;
  self.watched_tiles = 0;
  self.counters.clear();
  if (keep_hits && sizes == ViewSizes::kAhead && self.can_trace_ahead()) {
    self.trace_ahead(gaussians);
    return;
  }
  if (self.pool.size() == 0) self.grow_pool(keep_hits ? 2 * self.packet_count() : 1);
  if (keep_hits) self.traced_whole = true;
  self.trace_faces(gaussians, keep_hits);
  if (!keep_hits) return;
  const std::size_t wanted = self.chunks_wanted();
  self.hits_complete = wanted <= self.view_room();
  if (self.hits_complete) return;
  self.grow_pool(wanted);
  if (wanted > self.pool_limit()) {  // backward() traces again, band by band
    self.traced_whole = false;
    return;
  }
  self.counters.clear();
  self.trace_faces(gaussians, true);
  self.hits_complete = self.chunks_wanted() <= self.view_room();
}

bool CameraTracer::Impl::can_trace_ahead() const {
  const auto across = [this](int pixels) {
    return static_cast<std::size_t>((pixels + packet.tile - 1) / packet.tile);
  };
  return traced_whole && lists.can_build_ahead(across(camera.width) * across(camera.height));
}

// With the room that there is, without asking the device whether it is enough.
void CameraTracer::Impl::trace_ahead(const DeviceGaussians& gaussians) {
  FaultInjection& faults = context.faults();
  room = faults.strikes(Fault::kHits) ? 0 : static_cast<std::uint32_t>(view_room());
  const std::size_t budget =
      faults.strikes(Fault::kLists) ? 0 : MemoryShares(options, context.device()).tile_lists();
  for (const int number : faces()) {
    set_face(gaussians, number);
    lists.build_ahead(boxes, camera, whole(), budget, counters, overflow);
    launch_forward(whole(), true);
  }
  const std::size_t packets = packet_count();
  check_streams.launch(Range::linear(packets, kStreamGroup), static_cast<std::uint32_t>(packets),
                       room, counters, overflow, stream_ends);
  hits_complete = true;
}

bool CameraTracer::traces(const Camera& camera) {
  if (camera.model == CameraModel::kOrthographic) return false;
  require_pixels(camera);
  return lens_kind(camera) == 0 || impl_->lens.prepare(camera);
}

// Lines and outlines of all Gaussians as the face sees them.
void CameraTracer::Impl::set_face(const DeviceGaussians& gaussians, int number) {
  face = number;
  camera = device_camera(view, options.near_depth, number);
  lists.prepare(gaussians, camera, {lens_kind, number, lens_kind > 0 ? &lens : nullptr}, options);
}

void CameraTracer::Impl::trace_faces(const DeviceGaussians& gaussians, bool keep) {
  room = static_cast<std::uint32_t>(keep ? view_room() : 0);
  for (const int number : faces()) {
    set_face(gaussians, number);
    const TileWindow window = keep ? whole() : share();
    if (window.rows > 0) trace_window(gaussians, window, keep);
  }
}

// With the whole pool.
void CameraTracer::Impl::trace_rows(const DeviceGaussians& gaussians,
                                    std::uint32_t row,
                                    std::uint32_t rows) {
  room = static_cast<std::uint32_t>(pool_capacity());
  trace_window(gaussians, tile_window(row, rows), true);
}

// Splits the window until the candidate lists of each part fit their share of the budget.
void CameraTracer::Impl::trace_window(const DeviceGaussians& gaussians,
                                      const TileWindow& window,
                                      bool keep) {
  if (!lists.build(boxes, camera, window, MemoryShares(options, context.device()).tile_lists(),
                   counters)) {
    if (keep) traced_whole = false;
    for (const TileWindow& half : window.halves()) trace_window(gaussians, half, keep);
    return;
  }
  launch_forward(window, keep);
}

BuildOptions CameraTracer::Impl::packet_build() const {
  BuildOptions build;
  build.define("PACKET", packet.grouped ? 1 : packet.lanes)
      .define("TILE", packet.tile)
      .define("CHUNK", kChunkEntries)
      .define("LENS", lens_kind);
  if (packet.grouped) build.define("GROUP", packet.lanes);
  return build;
}

// With subgroups, where the packet has them. Only the compiled kernel tells how large they are; a
// kernel whose work-groups are several of them is built again without.
Kernel CameraTracer::Impl::group_kernel(const char* file,
                                        const char* name,
                                        const BuildOptions& build) {
  if (!packet.subgroups) return context.kernel(file, name, build);
  BuildOptions one = build;
  one.define("SUBGROUP", packet.sized ? 2 : 1)
      .language(context.device().version.starts_with("OpenCL 3.") ? "CL3.0" : "CL2.0");
  Kernel kernel = context.kernel(file, name, one);
  const std::size_t number = kernel.subgroups(lane_items());
  if (number == 1) return kernel;
  if (options.packet_form == PacketForm::kSubgroup) {
    throw DeviceError(fmt::format(
        "{} makes {} subgroups of a packet of {} rays in kernel {}, which has to be one: choose "
        "another --packet-width, or --packet-shape group",
        context.device().name, number, packet.lanes, name));
  }
  packet.subgroups = false;
  return context.kernel(file, name, build);
}

Kernel& CameraTracer::Impl::forward_kernel(bool keep) {
  const int variant =
      (options.depth ? 1 : 0) | (options.hit_order == HitOrder::kPeak ? 2 : 0) | lens_kind << 2;
  if (variant != forward_variant) {
    forward_variant = variant;
    forward_kernels = {};
  }
  Kernel& kernel = forward_kernels[keep ? 1 : 0];
  if (!kernel) {
    BuildOptions build = packet_build();
    if (!packet.grouped) build.define("BLOCK", packet.block).define("PENDING", packet.pending);
    build.define("PEAK_ORDER", options.hit_order == HitOrder::kPeak ? 1 : 0)
        .define("WITH_DEPTH", options.depth ? 1 : 0)
        .define("KEEP_HITS", keep ? 1 : 0);
    if (counters.size() > RS_COUNT_WORDS) build.define("COUNT_WORK", 1);
    kernel = packet.grouped ? group_kernel("trace/group_forward.cl", "trace_forward_group", build)
                            : context.kernel("trace/forward.cl", "trace_forward", build);
  }
  return kernel;
}

// Rows [row, row + rows) of `columns` tiles, counted from the first tile of the candidate lists or
// the image; a work-item for every block x block packets, or a work-group for every packet.
Range CameraTracer::Impl::packet_range(const Kernel& kernel,
                                       int block,
                                       std::uint32_t columns,
                                       std::uint32_t row,
                                       std::uint32_t rows) const {
  PacketShape item = packet;
  item.width *= block;
  item.height *= block;
  const auto tile = static_cast<std::size_t>(item.tile / item.height);
  const std::size_t across =
      std::min(columns * static_cast<std::size_t>(item.tile / item.width),
               static_cast<std::size_t>((camera.width + item.width - 1) / item.width));
  Range range;
  if (packet.grouped) {
    range = {{across * lane_items(), rows * tile, 1}, {lane_items(), 1, 1}, {}};
  } else {
    const auto group = packet_group(item, kernel.max_work_group_size());
    range = Range::plane(across, rows * tile, group[0], group[1]);
  }
  range.offset[1] = row * tile;
  return range;
}

void CameraTracer::Impl::launch_forward(const TileWindow& window, bool keep) {
  Kernel& kernel = forward_kernel(keep);
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
  pass.min_transmittance = options.min_transmittance;
  pass.max_hits = options.max_hits;
  pass.pool_capacity = keep ? room : 0;
  in_bands(context, budget, rows, [&](std::uint32_t first, std::uint32_t number) {
    kernel.launch(packet_range(kernel, packet.block, columns, first, number), lists.arguments(),
                  view_arguments(), pass, stream_arguments(), image, depth, counters);
    if (!watch) return;
    context.finish();
    watched_tiles += std::size_t{number} * columns;
    watch(std::min(1.0, static_cast<double>(watched_tiles) / all));
  });
}

CameraTracer::Statistics CameraTracer::Impl::count_statistics() const {
  const std::vector<std::uint32_t> words = counters.download();
  const auto wide = [&](std::size_t low) {
    return std::uint64_t{words[low + 1]} << 32 | words[low];
  };
  return {words[RS_COUNT_CAPPED], wide(RS_COUNT_CANDIDATES), wide(RS_COUNT_HITS),
          words[RS_COUNT_CHUNKS] * chunk_bytes()};
}

// Of the pass just enqueued, whose statistics stay: waits for the device.
std::size_t CameraTracer::Impl::chunks_wanted() {
  saved = count_statistics();
  statistics_saved = true;
  return saved.stream_bytes / chunk_bytes();
}

void CameraTracer::Impl::grow_pool(std::size_t chunks, std::size_t least) {
  const std::size_t room =
      std::max<std::size_t>({std::min(chunks + chunks / 4, pool_limit()), least, std::size_t{1}});
  pool.ensure(context, room * kChunkEntries, "hit pool");
  pool_transmittance.ensure(context, pool.size() * static_cast<std::size_t>(packet.lanes),
                            "hit transmittances");
}

void CameraTracer::Impl::launch_backward(const Buffer<float>& image_gradient,
                                         std::uint32_t row,
                                         std::uint32_t rows) {
  BuildOptions build = packet_build();
  build.define("DEPTH_GRADIENT", depth_gradient != nullptr ? 1 : 0);
  sums.define(build);
  Kernel kernel = packet.grouped
                      ? group_kernel("trace/group_backward.cl", "trace_backward_group", build)
                      : context.kernel("trace/backward.cl", "trace_backward", build);
  RsBackward pass{};
  pass.gaussians = static_cast<std::uint32_t>(count);
  pass.copies = static_cast<std::uint32_t>(sums.copies());
  pass.tiles_x = lists.tiles_x();
  std::copy(options.background.begin(), options.background.end(), pass.background);
  pass.screen_x = screen_x();
  pass.screen_y = screen_y();
  // No ray meets a Gaussian twice.
  pass.limit = GradientSums::limit(packet_count() * static_cast<std::size_t>(packet.lanes));
  const bool shared = !sums.is_private();
  in_bands(context, backward_budget, rows, [&](std::uint32_t first, std::uint32_t number) {
    const Range range = shared
                            ? packet_range(kernel, 1, lists.tiles_x(), first, number)
                            : Range{{sums.copies() * lane_items(), 1, 1}, {lane_items(), 1, 1}, {}};
    // Shared sums find their rows by the offset of the launch.
    pass.tile_row = shared ? row : row + first;
    pass.tile_rows = number;
    kernel.launch(range, view_arguments(), pass, stream_arguments(), lists.lines(), image_gradient,
                  depth_gradient != nullptr ? *depth_gradient : no_depth_gradient, sums.target());
  });
}

// Traces rows again with the pool to themselves, then runs them backwards; halves them until their
// hits fit.
void CameraTracer::Impl::backward_rows(const DeviceGaussians& gaussians,
                                       const Buffer<float>& image_gradient,
                                       std::uint32_t row,
                                       std::uint32_t rows) {
  counters.clear();
  trace_rows(gaussians, row, rows);
  const std::size_t wanted = counters.read(RS_COUNT_CHUNKS);
  if (wanted > pool_capacity() && rows > 1) {
    backward_rows(gaussians, image_gradient, row, rows / 2);
    backward_rows(gaussians, image_gradient, row + rows / 2, rows - rows / 2);
    return;
  }
  // A row of tiles is the least, whatever its share of the budget.
  if (wanted > pool_capacity()) {
    if (wanted > largest_pool()) {
      throw ResourceError(fmt::format(
          "The hits of one row of tiles need {:.1f} MiB, the device has buffers of {:.1f} MiB: "
          "raise --downscale",
          static_cast<double>(wanted * chunk_bytes()) / (1 << 20),
          static_cast<double>(largest_pool() * chunk_bytes()) / (1 << 20)));
    }
    grow_pool(wanted, wanted);
    counters.clear();
    trace_rows(gaussians, row, rows);
  }
  launch_backward(image_gradient, row, rows);
}

void CameraTracer::Impl::finalize(const DeviceGaussians& gaussians,
                                  GaussianGradients& gradients,
                                  bool accumulate,
                                  bool with_pose) {
  const std::size_t n = gaussians.count;
  gradients.ensure(context, gaussians);
  pose.ensure(context, with_pose ? 6 * n : 1, "pose gradients");
  BuildOptions build;
  build.define("SIGMOID_SCALE", gaussians.activation == ScaleActivation::kSigmoid ? 1 : 0)
      .define("POSE", with_pose ? 1 : 0)
      .define("ACCUMULATE", accumulate ? 1 : 0)
      .define("DEPTH_GRADIENT", depth_gradient != nullptr ? 1 : 0)
      .define("ANGULAR", lens_kind == 2 ? 1 : 0)
      .define("SH_DEGREE", gaussians.active_sh_degree)
      .define("SH_COEFFICIENTS", sh_coefficients(gaussians.sh_degree));
  const bool cpu = context.device().type == DeviceType::kCpu;
  GaussianKernel kernel(context, cpu ? "trace/finalize_gradients.cl" : "trace/group_finalize.cl",
                        cpu ? "finalize_gradients" : "finalize_group", build);
  const RsFinalize pass{static_cast<std::uint32_t>(n), static_cast<std::uint32_t>(sums.copies()),
                        screen_x(), screen_y()};
  kernel.launch(n, pass, camera, sums.lines(), lists.bounds(), lists.lines(), gaussians.arguments(),
                gradients.arguments(), pose);
}

void CameraTracer::backward(const DeviceGaussians& gaussians,
                            const Buffer<float>& image_gradient,
                            GaussianGradients& gradients,
                            PoseGradient* pose,
                            const Buffer<float>* depth_gradient) {
  Impl& self = *impl_;
  if (!self.hits_kept || self.count != gaussians.count || self.revision != gaussians.revision) {
    throw UsageError(
        "CameraTracer::backward() must follow forward(keep_hits = true) of the same Gaussians");
  }
  self.depth_gradient = depth_gradient;
  bool further = false;
  for (const int number : self.faces()) {
    if (self.faces().size() > 1) self.set_face(gaussians, number);
    self.backward_face(gaussians, image_gradient);
    self.sums.round();
    self.finalize(gaussians, gradients, further, false);
    self.sums.settle();
    if (pose != nullptr) {
      if (!further) *pose = {};
      self.add_pose(gaussians, *pose);
    }
    further = true;
  }
}

// Gradients of the lines of one face.
void CameraTracer::Impl::backward_face(const DeviceGaussians& gaussians,
                                       const Buffer<float>& image_gradient) {
  sums.prepare(GradientSumChoice::of(options, context.device(), gaussians.count,
                                     MemoryShares(options, context.device()).packet_gradients(),
                                     kCopiesPerUnit),
               gaussians.count);
  if (hits_complete) {
    launch_backward(image_gradient, 0, lists.tile_rows());
    return;
  }
  // Bands whose hits should fit, so that few are traced only to find that they do not.
  const std::size_t wanted = saved.stream_bytes / chunk_bytes();
  const std::size_t all = lists.tile_rows();
  const auto band =
      static_cast<std::uint32_t>(std::max<std::size_t>(1, all * pool_capacity() * 3 / 4 / wanted));
  for (std::uint32_t row = 0; row < all; row += band) {
    backward_rows(gaussians, image_gradient, row,
                  std::min(band, static_cast<std::uint32_t>(all) - row));
  }
}

// What the lines of one face, whose sums are still there, say of the pose.
void CameraTracer::Impl::add_pose(const DeviceGaussians& gaussians, PoseGradient& sum) {
  finalize(gaussians, pose_scratch, false, true);
  const std::vector<float> parts = pose.download();
  std::array<double, 6> total{};
  for (std::size_t i = 0; i + 6 <= parts.size(); i += 6) {
    for (std::size_t j = 0; j < 6; ++j) total[j] += static_cast<double>(parts[i + j]);
  }
  // A turn in camera axes is the same turn in the axes of the face.
  const glm::dvec3 turn =
      glm::transpose(LensTiles::rotation(face)) * glm::dvec3(total[3], total[4], total[5]);
  for (std::size_t j = 0; j < 3; ++j) {
    sum.center[j] += total[j];
    sum.rotation[j] += turn[static_cast<int>(j)];
  }
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
