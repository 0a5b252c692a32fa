// SPDX-License-Identifier: Apache-2.0
#include "light/ray_view_tracer.hpp"

#include <fmt/format.h>

#include <algorithm>

#include "raysplats/error.hpp"
#include "trace/camera_rays.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kGroup = 64;
// A ray with its result, surface hit and gradients, and once more for a reflected one.
constexpr std::size_t kPathBytes = 2 * (sizeof(Ray) + sizeof(RayResult) + sizeof(RsSurfaceHit) +
                                        sizeof(RsPath) + 2 * sizeof(RayBackward::Gradient) + 4);
constexpr std::size_t kLeastBatch = 4096;
// Updates after which the tree is built anew: in between it is refitted.
constexpr int kRefits = 32;

std::uint32_t u32(std::size_t value) { return static_cast<std::uint32_t>(value); }

TraceOptions ray_options(TraceOptions options) {
  if (options.near_depth > 0.0f) {
    throw UsageError(
        fmt::format("The near plane at {} cuts for pinholes only, and rays are traced one by one "
                    "here: use --near 0",
                    options.near_depth));
  }
  options.background = {0.0f, 0.0f, 0.0f};  // MirrorPaths adds it
  return options;
}

std::size_t pixels_of(const Camera& camera) {
  return static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height);
}

}  // namespace

struct RayViewTracer::Impl {
  Impl(Context& context_in, const TraceOptions& options, const Mirrors& mirrors)
      : context(context_in),
        background(options.background),
        tracer(context_in, ray_options(options)),
        camera_rays(context_in),
        paths(context_in, tracer, mirrors),
        sums(context_in, tracer) {}

  std::size_t batch() const { return RayViewTracer::batch(tracer.options().memory_budget); }
  void trace(const DeviceGaussians& gaussians, std::size_t first, std::size_t count);
  Kernel kernel(const char* name) { return context.kernel("light/mirror_paths.cl", name); }

  Context& context;
  std::array<float, 3> background;
  RayTracer tracer;
  CameraRays camera_rays;
  MirrorPaths paths;
  RayBackward sums;
  std::size_t count = 0;  // Gaussians of the tree
  int refits = 0;
  Camera camera;
  bool kept = false;
  std::uint64_t capped = 0;  // of the batches before the last
  Buffer<float> image;
};

std::size_t RayViewTracer::batch(std::size_t memory_budget) {
  return std::max(kLeastBatch, memory_budget / 4 / kPathBytes);
}

RayViewTracer::RayViewTracer(Context& context, const TraceOptions& options, const Mirrors& mirrors)
    : impl_(std::make_unique<Impl>(context, options, mirrors)) {}
RayViewTracer::~RayViewTracer() = default;

const Buffer<float>& RayViewTracer::image() const { return impl_->image; }

void RayViewTracer::set_background(const std::array<float, 3>& background) {
  impl_->background = background;
}

std::uint64_t RayViewTracer::capped_rays() const {
  return impl_->capped + impl_->paths.capped_rays();
}

void RayViewTracer::update(const DeviceGaussians& gaussians) {
  Impl& self = *impl_;
  if (gaussians.count == self.count && self.refits < kRefits && self.count > 0) {
    self.tracer.refit(gaussians);
    ++self.refits;
    return;
  }
  self.tracer.update(gaussians);
  self.count = gaussians.count;
  self.refits = 0;
}

void RayViewTracer::Impl::trace(const DeviceGaussians& gaussians,
                                std::size_t first,
                                std::size_t count) {
  camera_rays.generate(camera, Lens{}, first, count, paths.rays());
  paths.trace(gaussians, count, color_direction(camera), background);
}

void RayViewTracer::forward(const DeviceGaussians& gaussians, const Camera& camera, bool keep) {
  Impl& self = *impl_;
  require_pixels(camera);
  self.camera = camera;
  self.kept = keep;
  self.capped = 0;
  const std::size_t pixels = pixels_of(camera);
  self.image.ensure(self.context, 4 * pixels, "image");
  for (std::size_t first = 0; first < pixels; first += self.batch()) {
    if (first > 0) self.capped += self.paths.capped_rays();
    const std::size_t count = std::min(self.batch(), pixels - first);
    self.trace(gaussians, first, count);
    self.kernel("store_picture")
        .launch(Range::linear(count, kGroup), u32(count), u32(first), u32(pixels),
                self.paths.seen(), self.image);
  }
}

Image RayViewTracer::download_image() const {
  const Impl& self = *impl_;
  const std::vector<float> planes = self.image.download();
  Image out(self.camera.width, self.camera.height, 4);
  const std::size_t pixels = out.pixels();
  for (std::size_t i = 0; i < pixels; ++i) {
    for (std::size_t c = 0; c < 4; ++c) out.data[4 * i + c] = planes[c * pixels + i];
  }
  return out;
}

void RayViewTracer::backward(const DeviceGaussians& gaussians,
                             const Buffer<float>& image_gradient,
                             GaussianGradients& gradients) {
  Impl& self = *impl_;
  const std::size_t pixels = pixels_of(self.camera);
  if (!self.kept || self.count != gaussians.count || image_gradient.size() < 4 * pixels) {
    throw UsageError(
        "RayViewTracer::backward() must follow forward(keep = true) of the same Gaussians, with a "
        "gradient of the picture's size");
  }
  self.sums.begin(gaussians, RayScreen::of(self.camera), pixels * self.paths.segments());
  for (std::size_t first = 0; first < pixels; first += self.batch()) {
    const std::size_t count = std::min(self.batch(), pixels - first);
    if (self.batch() < pixels) self.trace(gaussians, first, count);
    self.paths.gradients().ensure(self.context, count, "ray gradients");
    self.kernel("load_gradients")
        .launch(Range::linear(count, kGroup), u32(count), u32(first), u32(pixels), image_gradient,
                self.paths.gradients());
    self.paths.backward(gaussians, self.sums);
  }
  self.sums.finish(gaussians, gradients);
}

}  // namespace raysplats
