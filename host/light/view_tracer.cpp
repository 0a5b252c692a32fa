// SPDX-License-Identifier: Apache-2.0
#include "light/view_tracer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "device/kernel.hpp"
#include "light/mirror_paths.hpp"
#include "raysplats/error.hpp"
#include "scene/camera/camera_check.hpp"
#include "scene/image/pixel_count.hpp"
#include "scene/image/planes.hpp"
#include "scene/image/row_share.hpp"
#include "trace/camera_rays.hpp"
#include "trace/memory_shares.hpp"
#include "trace/ray_backward.hpp"
#include "trace/view_sizes.h"

namespace raysplats {
namespace {

constexpr std::size_t kGroup = 64;
// A ray with its result, surface hit and gradients, and once more for a reflected one.
constexpr std::size_t kPathBytes =
    2 * (sizeof(Ray) + sizeof(RsCone) + sizeof(RayResult) + sizeof(RsSurfaceHit) + sizeof(RsPath) +
         2 * sizeof(RayBackward::ResultGradient) + 4);
constexpr std::size_t kLeastBatch = 4096;
constexpr std::size_t kWatchedBatch = std::size_t{1} << 16;

TraceOptions ray_options(TraceOptions options) {
  options.background = {0.0f, 0.0f, 0.0f};  // MirrorPaths adds it
  options.sky.clear();
  return options;
}

void require_no_sky() {
  throw UsageError(
      "Mirrors show one colour behind everything, no sky: choose a background, or leave out the "
      "mirrors");
}

void require_no_more_than_mirrors_show(const TraceOptions& options) {
  if (options.depth) {
    throw UsageError("A picture with mirrors has no single depth: leave out TraceOptions::depth");
  }
  if (options.near_depth > 0.0f) {
    throw UsageError(
        fmt::format("The near plane at {} would cut what mirrors show as well: use --near 0",
                    options.near_depth));
  }
  if (options.traversal == Traversal::kTiles) {
    throw UsageError(
        "Scenes with mirrors cannot be traced by tiles: choose traversal auto or bvh, or leave out "
        "the mirrors");
  }
}

std::uint64_t count_of(const Buffer<std::uint32_t>& counter) {
  const std::vector<std::uint32_t> words = counter.download();
  return std::uint64_t{words[1]} << 32 | words[0];
}

glm::dvec3 vector(const float* v) { return {v[0], v[1], v[2]}; }

}  // namespace

// Views ray by ray.
struct ViewTracer::Rays {
  Rays(Context& context, const TraceOptions& options, const Mirrors& mirrors)
      : tracer(context, ray_options(options)),
        generator(context),
        paths(context, tracer, mirrors),
        sums(context, tracer),
        capped(context, 2, "capped rays"),
        traced_again(context, 2, "capped rays that are counted already") {
    capped.clear();
    traced_again.clear();
  }

  void add_pose(const Camera& camera, std::size_t count, PoseGradient& pose);

  RayTracer tracer;
  CameraRays generator;
  MirrorPaths paths;
  RayBackward sums;
  // Rays that stopped because of max_hits, as counters of 64 bits in two words.
  Buffer<std::uint32_t> capped;  // of the last view
  Buffer<std::uint32_t> traced_again;
  Buffer<RayBackward::PaddedRayGradient> ray_gradients;
};

struct ViewTracer::Impl {
  Impl(Context& context_in, const TraceOptions& options_in, Mirrors mirrors_in)
      : context(context_in),
        options(options_in),
        background(options_in.background),
        mirrors(std::move(mirrors_in)),
        tree(walks_tree(options_in, context_in.device())),
        packets(context_in, options_in) {
    set_background(options_in.background, options_in.sky);
  }

  void set_background(const std::array<float, 3>& color, const SkyLight& light) {
    check_background(color);
    if (!light.empty() && !mirrors.meshes.empty()) require_no_sky();
    if (sky || !light.empty()) kept = false;
    background = light.empty() ? color : std::array<float, 3>{};
    if (light.empty()) {
      sky.reset();
    } else {
      sky.emplace(context, light);
    }
  }
  // Pictures to be differentiated are of rays that are no cones, whose gradient is known.
  Rays& single_rays(bool keep) {
    const bool bare = keep || !has_cones(options);
    std::optional<Rays>& wanted = bare ? bare_rays : cones;
    if (!wanted) wanted.emplace(context, bare ? of_bare_rays(options) : options, mirrors);
    rays = &*wanted;
    return *rays;
  }
  std::size_t batch() const {
    const std::size_t most = ViewTracer::batch(options, context.device());
    return watch ? std::min(most, kWatchedBatch) : most;
  }
  Kernel kernel(const char* name) { return context.kernel("light/mirror_paths.cl", name); }
  // Of a picture that is traced ray by ray.
  std::array<int, 2> ray_rows() const { return share_of_rows(camera.height, part, parts); }
  void trace_batch(const DeviceGaussians& gaussians,
                   std::size_t first,
                   std::size_t count,
                   const Buffer<std::uint32_t>& counter);
  void forward_rays(const DeviceGaussians& gaussians, bool keep);
  void backward_rays(const DeviceGaussians& gaussians,
                     const Buffer<float>& image_gradient,
                     GaussianGradients& gradients,
                     PoseGradient* pose);

  Context& context;
  TraceOptions options;
  std::array<float, 3> background;  // of the next view; options have that of the last
  std::optional<Sky> sky;           // behind it, then the background is black
  Mirrors mirrors;
  bool tree;  // rays walk it though they could be traced by tiles
  CameraTracer packets;
  std::uint64_t packets_revision = 0;
  std::optional<Rays> bare_rays, cones;  // once a view needs them
  Rays* rays = nullptr;                  // those that the last such view took
  std::function<void(double)> watch;
  std::size_t part = 0, parts = 1;  // of pictures
  // The last view.
  bool by_rays = false;
  std::uint64_t reflected_rays = 0;  // where by_rays
  bool own_image = false;            // `image` is what it shows, else that of `packets`
  bool kept = false;
  std::uint64_t revision = 0;  // of its Gaussians
  Camera camera;
  bool rays_whole = false;  // what `rays` traced last are all pixels of `camera`
  Buffer<float> image;
  Buffer<float> depth;
};

std::size_t ViewTracer::batch(const TraceOptions& options, const DeviceInfo& device) {
  return std::max(kLeastBatch, MemoryShares(options, device).ray_batch() / kPathBytes);
}

ViewTracer::ViewTracer(Context& context, const TraceOptions& options, Mirrors mirrors)
    : impl_(std::make_unique<Impl>(context, options, std::move(mirrors))) {
  if (impl_->mirrors.meshes.empty() && impl_->mirrors.max_bounces >= 0) return;
  require_no_more_than_mirrors_show(options);
  impl_->single_rays(false);
}
ViewTracer::~ViewTracer() = default;

std::size_t ViewTracer::triangles() const {
  std::size_t sum = 0;
  for (const Mesh& mesh : impl_->mirrors.meshes) sum += mesh.triangle_count();
  return sum;
}

bool ViewTracer::by_rays(const Camera& camera) const {
  Impl& self = *impl_;
  if (!self.mirrors.meshes.empty() || self.tree) return true;
  return self.options.traversal != Traversal::kTiles && !self.packets.traces(camera);
}

void ViewTracer::begin_programs(const DeviceGaussians& gaussians,
                                const Camera& camera,
                                bool keep,
                                bool depth_gradient) {
  if (!by_rays(camera)) impl_->packets.begin_programs(gaussians, camera, keep, depth_gradient);
}

void ViewTracer::forward(const DeviceGaussians& gaussians,
                         const Camera& camera,
                         bool keep,
                         ViewSizes sizes) {
  Impl& self = *impl_;
  require_pixels(camera);
  require_room(camera, self.context.device());
  if (by_rays(camera)) {
    forward_rays(gaussians, camera, keep);
    return;
  }
  self.kept = false;
  if (self.packets_revision != gaussians.revision) {
    self.packets_revision = 0;
    self.packets.update(gaussians);
    self.packets_revision = gaussians.revision;
  }
  self.options.background = self.background;
  self.packets.set_background(self.background);
  self.packets.forward(gaussians, camera, keep, sizes);
  self.by_rays = false;
  if (self.sky) {
    // backward() may trace parts again, over black.
    self.image.ensure(self.context, 4 * pixel_count(camera), "image");
    self.image.copy_from(self.packets.image(), 4 * pixel_count(camera));
    self.sky->show(camera, self.image);
  }
  self.own_image = self.sky.has_value();
  self.camera = camera;
  self.kept = keep;
  self.revision = gaussians.revision;
}

RayTracer* ViewTracer::ray_tracer() {
  return impl_->rays != nullptr ? &impl_->rays->tracer : nullptr;
}

void ViewTracer::forward_rays(const DeviceGaussians& gaussians, const Camera& camera, bool keep) {
  Impl& self = *impl_;
  require_pixels(camera);
  require_room(camera, self.context.device());
  self.kept = false;
  self.by_rays = true;
  self.camera = camera;
  self.options.background = self.background;
  self.single_rays(keep).tracer.follow(gaussians);
  self.forward_rays(gaussians, keep);
  self.own_image = true;
  if (self.sky) self.sky->show(camera, self.image);
  self.kept = keep;
  self.revision = gaussians.revision;
}

void ViewTracer::Impl::trace_batch(const DeviceGaussians& gaussians,
                                   std::size_t first,
                                   std::size_t count,
                                   const Buffer<std::uint32_t>& counter) {
  rays_whole = false;
  rays->tracer.set_near(RayNear::of(camera, options.near_depth));
  rays->generator.generate(camera, Lens{}, first, count, rays->paths.rays());
  if (has_cones(rays->tracer.options())) {
    rays->generator.cones(camera, options.view_footprint, rays->paths.rays(), count,
                          rays->paths.cones());
  }
  rays->paths.trace(gaussians, count, color_direction(camera), options.background, counter);
  rays_whole = count == pixel_count(camera);
}

void ViewTracer::Impl::forward_rays(const DeviceGaussians& gaussians, bool keep) {
  MirrorPaths& paths = rays->paths;
  rays->capped.clear();
  reflected_rays = 0;
  const std::size_t pixels = pixel_count(camera);
  image.ensure(context, 4 * pixels, "image");
  if (options.depth) depth.ensure(context, 3 * pixels, "depth");
  const auto [top, bottom] = keep ? std::array<int, 2>{0, camera.height} : ray_rows();
  const auto row = static_cast<std::size_t>(camera.width);
  const std::size_t begin = row * static_cast<std::size_t>(top);
  const std::size_t end = row * static_cast<std::size_t>(bottom);
  for (std::size_t first = begin; first < end; first += batch()) {
    const std::size_t count = std::min(batch(), end - first);
    trace_batch(gaussians, first, count, rays->capped);
    reflected_rays += paths.reflected_rays();
    kernel("store_picture")
        .launch(Range::linear(count, kGroup), u32(count), u32(first), u32(pixels), paths.seen(),
                image);
    if (options.depth) {
      kernel("store_depth")
          .launch(Range::linear(count, kGroup), u32(count), u32(first), u32(pixels),
                  depth_axis(camera), paths.rays(), paths.results(), depth);
    }
    if (!watch) continue;
    context.finish();
    watch(static_cast<double>(first + count - begin) / static_cast<double>(end - begin));
  }
}

void ViewTracer::set_share(std::size_t part, std::size_t parts) {
  impl_->part = part;
  impl_->parts = parts;
  impl_->packets.set_share(part, parts);
}

std::array<int, 2> ViewTracer::rows() const {
  return impl_->by_rays ? impl_->ray_rows() : impl_->packets.rows();
}

const Buffer<float>& ViewTracer::image() const {
  return impl_->own_image ? impl_->image : impl_->packets.image();
}

const Buffer<float>& ViewTracer::depth() const {
  return impl_->by_rays ? impl_->depth : impl_->packets.depth();
}

Image ViewTracer::download_image() const {
  const Impl& self = *impl_;
  if (!self.own_image) return self.packets.download_image();
  return interleaved(self.image.download(), self.camera.width, self.camera.height, 4);
}

Image ViewTracer::download_depth() const {
  const Impl& self = *impl_;
  if (!self.by_rays) return self.packets.download_depth();
  if (!self.options.depth) throw UsageError("Depth was not traced: set TraceOptions::depth");
  return interleaved(self.depth.download(), self.camera.width, self.camera.height, 3);
}

void ViewTracer::backward(const DeviceGaussians& gaussians,
                          const Buffer<float>& image_gradient,
                          GaussianGradients& gradients,
                          PoseGradient* pose,
                          const Buffer<float>* depth_gradient) {
  Impl& self = *impl_;
  if (!self.kept || self.revision != gaussians.revision) {
    throw UsageError(
        "Tracer::backward() must follow render(differentiable = true) of the same model, "
        "unchanged");
  }
  if (image_gradient.size() < 4 * pixel_count(self.camera)) {
    throw UsageError(fmt::format(
        "The gradient of a picture of {} numbers has {}: give one for every channel of every pixel",
        4 * pixel_count(self.camera), image_gradient.size()));
  }
  if (self.sky && pose != nullptr) {
    throw UsageError(
        "The gradient of a pose is not known where there is a sky, which turns with it: choose a "
        "background of one colour");
  }
  if (self.by_rays && depth_gradient != nullptr) {
    throw UsageError(
        "The gradient of depth is not known where rays are traced one by one: choose traversal "
        "auto or tiles, and cameras with a centre");
  }
  const Buffer<float>& over_black =
      self.sky ? self.sky->backward(self.camera, image(), image_gradient) : image_gradient;
  if (self.by_rays) {
    self.backward_rays(gaussians, over_black, gradients, pose);
    return;
  }
  self.packets.backward(gaussians, over_black, gradients, pose, depth_gradient);
}

void ViewTracer::Impl::backward_rays(const DeviceGaussians& gaussians,
                                     const Buffer<float>& image_gradient,
                                     GaussianGradients& gradients,
                                     PoseGradient* pose) {
  MirrorPaths& paths = rays->paths;
  if (pose != nullptr) *pose = {};
  const std::size_t pixels = pixel_count(camera);
  rays->sums.begin(gaussians, RayScreen::of(camera), pixels * paths.segments());
  for (std::size_t first = 0; first < pixels; first += batch()) {
    const std::size_t count = std::min(batch(), pixels - first);
    // Whoever watched forward() may have made its batches smaller than those here.
    if (count < pixels || !rays_whole) trace_batch(gaussians, first, count, rays->traced_again);
    paths.gradients().ensure(context, count, "ray gradients");
    kernel("load_gradients")
        .launch(Range::linear(count, kGroup), u32(count), u32(first), u32(pixels), image_gradient,
                paths.gradients());
    paths.backward(gaussians, rays->sums, pose != nullptr ? &rays->ray_gradients : nullptr);
    if (pose != nullptr) rays->add_pose(camera, count, *pose);
  }
  rays->sums.finish(gaussians, gradients);
}

// Moving the centre moves every origin; a turn moves directions, and origins that are not the
// centre.
void ViewTracer::Rays::add_pose(const Camera& camera,
                                std::size_t count_of_rays,
                                PoseGradient& pose) {
  std::vector<Ray> traced(count_of_rays);
  std::vector<RayBackward::PaddedRayGradient> by_ray(count_of_rays);
  paths.rays().download(std::span<Ray>(traced));
  ray_gradients.download(std::span<RayBackward::PaddedRayGradient>(by_ray));
  const glm::dvec3 center = camera.center();
  glm::dvec3 by_center(0.0), turn(0.0);
  for (std::size_t i = 0; i < count_of_rays; ++i) {
    const glm::dvec3 by_origin = vector(by_ray[i].data());
    by_center += by_origin;
    turn += glm::cross(vector(traced[i].direction), vector(by_ray[i].data() + 4)) +
            glm::cross(vector(traced[i].origin) - center, by_origin);
  }
  // A turn w of the world-to-camera rotation turns rays by -w.
  const glm::dvec3 rotation = -(camera.rotation * turn);
  for (int k = 0; k < 3; ++k) {
    pose.center[static_cast<std::size_t>(k)] += by_center[k];
    pose.rotation[static_cast<std::size_t>(k)] += rotation[k];
  }
}

void ViewTracer::set_watch(const std::function<bool(double)>& watch) {
  impl_->watch = {};
  if (watch) {
    impl_->watch = [watch](double share) {
      if (!watch(share)) throw Error(ErrorCode::kInterrupted, "The picture was stopped");
    };
  }
  impl_->packets.set_watch(impl_->watch);
}

void ViewTracer::set_background(const std::array<float, 3>& background, const SkyLight& sky) {
  impl_->set_background(background, sky);
}

Sky* ViewTracer::sky() { return impl_->sky ? &*impl_->sky : nullptr; }

std::uint64_t ViewTracer::capped_rays() const {
  const Impl& self = *impl_;
  return self.by_rays ? count_of(self.rays->capped) : self.packets.statistics().capped_rays;
}

std::uint64_t ViewTracer::reflected_rays() const {
  return impl_->by_rays ? impl_->reflected_rays : 0;
}

CameraTracer::Statistics ViewTracer::statistics() const {
  return impl_->by_rays ? CameraTracer::Statistics() : impl_->packets.statistics();
}
ViewTracer::CappedRays ViewTracer::capped_on_device() const {
  const Impl& self = *impl_;
  if (self.by_rays) return {self.rays->capped, 0, true};
  return {self.packets.counters(), RS_COUNT_CAPPED, false};
}
const Buffer<std::uint32_t>& ViewTracer::overflow() const { return impl_->packets.overflow(); }
void ViewTracer::clear_overflow() { impl_->packets.clear_overflow(); }

const Context& ViewTracer::context() const { return impl_->context; }

}  // namespace raysplats
