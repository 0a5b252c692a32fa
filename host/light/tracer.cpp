// SPDX-License-Identifier: Apache-2.0
#include "raysplats/tracer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "device/foreign_opencl.hpp"
#include "light/normal_pictures.hpp"
#include "light/view_tracer.hpp"
#include "raysplats/error.hpp"
#include "raysplats/opencl.hpp"
#include "scene/image/planes.hpp"
#include "trace/memory_shares.hpp"
#include "trace/model_impl.hpp"
#include "trace/ray_backward.hpp"
#include "trace/ray_tracer.hpp"

namespace raysplats {
namespace {

// Of a ray on the device, with its result and gradients.
constexpr std::size_t kRayBytes = sizeof(Ray) + sizeof(RayResult) +
                                  sizeof(RayBackward::ResultGradient) +
                                  sizeof(RayBackward::PaddedRayGradient);
constexpr std::size_t kLeastBatch = 4096;
static_assert(sizeof(RayResultGradient) == sizeof(RayBackward::ResultGradient));

// Where the square leaves single precision, kernels let a ray meet nothing.
constexpr float kLongestVector = 1e19f;

bool finite(const float (&v)[3]) {
  return std::isfinite(v[0]) && std::isfinite(v[1]) && std::isfinite(v[2]);
}

float square(const float (&v)[3]) { return v[0] * v[0] + v[1] * v[1] + v[2] * v[2]; }

// As the kernels take it: an infinite end is the largest number.
Ray checked(const Ray& ray, std::size_t number) {
  const float* d = ray.direction;
  const float squares = square(ray.direction);
  const char* fault = nullptr;
  if (!finite(ray.origin) || !finite(ray.direction) || std::isnan(ray.t_max) ||
      !std::isfinite(ray.t_min)) {
    fault = "has a number that is not finite";
  } else if (!(squares >= std::numeric_limits<float>::min())) {
    fault = "has a direction of length 0";
  } else if (!(squares <= kLongestVector * kLongestVector)) {
    fault = "has a direction whose length is beyond 1e19";
  } else if (!(square(ray.origin) <= kLongestVector * kLongestVector)) {
    fault = "has an origin farther than 1e19 from 0";
  } else if (!(ray.t_min >= 0.0f)) {
    fault = "begins before its origin";
  } else if (ray.t_min > ray.t_max) {
    fault = "ends before it begins";
  }
  if (fault != nullptr) {
    throw UsageError(fmt::format(
        "Ray {} (origin {} {} {}, direction {} {} {}, t from {} to {}) {}: rays need finite "
        "numbers, a direction and 0 <= t_min <= t_max",
        number, ray.origin[0], ray.origin[1], ray.origin[2], d[0], d[1], d[2], ray.t_min, ray.t_max,
        fault));
  }
  Ray out = ray;
  out.t_max = std::min(out.t_max, std::numeric_limits<float>::max());
  return out;
}

// Lets a tracer be watched while it lives.
class Watch {
 public:
  Watch(ViewTracer& tracer, const std::function<bool(double)>& within) : tracer_(&tracer) {
    if (!within) return;
    tracer.set_watch([this, &within](double share) {
      stopped_ = !within(share);
      return !stopped_;
    });
  }
  ~Watch() { tracer_->set_watch({}); }
  Watch(const Watch&) = delete;
  Watch& operator=(const Watch&) = delete;
  bool stopped() const { return stopped_; }

 private:
  ViewTracer* tracer_;
  bool stopped_ = false;
};

// What a watch ends rays with.
struct Stopped {};

// Lets rays, which are taken in batches, be watched while it lives: as they are traced, or with
// `gradients` as these are taken, which tracing again brings no further.
class RayWatch {
 public:
  RayWatch(RayTracer& tracer,
           RayBackward& sums,
           bool gradients,
           std::size_t rays,
           const std::function<bool(double)>& within)
      : tracer_(&tracer), sums_(&sums) {
    if (!within) return;
    const auto ask = [this, rays, &within](double share) {
      const double done = static_cast<double>(first_) + share * static_cast<double>(count_);
      if (!within(done / static_cast<double>(rays))) throw Stopped();
    };
    tracer.set_watch([ask, gradients](double share) { ask(gradients ? 0.0 : share); });
    sums.set_watch(ask);
  }
  ~RayWatch() {
    tracer_->set_watch({});
    sums_->set_watch({});
  }
  RayWatch(const RayWatch&) = delete;
  RayWatch& operator=(const RayWatch&) = delete;

  void begin_batch(std::size_t first, std::size_t count) {
    first_ = first;
    count_ = count;
  }

 private:
  RayTracer* tracer_;
  RayBackward* sums_;
  std::size_t first_ = 0, count_ = 0;
};

Gaussians downloaded(const GaussianGradients& gradients, int sh_degree) {
  Gaussians out;
  out.sh_degree = sh_degree;
  out.means = gradients.means.download();
  out.quaternions = gradients.quaternions.download();
  out.log_scales = gradients.scales.download();
  out.opacities = gradients.opacities.download();
  out.sh = gradients.sh.download();
  return out;
}

}  // namespace

struct Tracer::Impl {
  Impl(Context& context_in, const TraceOptions& options_in, Mirrors mirrors_in)
      : context(context_in),
        options(options_in),
        mirrors(!mirrors_in.meshes.empty()),
        views(context_in, options_in, std::move(mirrors_in)),
        tracer(context_in, of_bare_rays(options_in)),
        sums(context_in, tracer) {}

  std::size_t batch() const {
    return std::max(kLeastBatch,
                    std::min<std::size_t>(
                        MemoryShares(options, context.device()).ray_batch() / kRayBytes,
                        context.device().max_allocation / sizeof(RayBackward::PaddedRayGradient)));
  }
  void require_bare_rays() const {
    if (!options.sky.empty()) {
      throw UsageError(
          "Single rays do not see the sky of this Tracer, which is of cameras' views: choose a "
          "background of one colour");
    }
    if (mirrors) {
      throw UsageError(
          "Single rays do not see the mirrors of this Tracer: trace them with one that has none");
    }
    if (options.near_depth <= 0.0f) return;
    throw UsageError(fmt::format(
        "TraceOptions::near_depth is {}, but single rays have no camera that could be near: use 0",
        options.near_depth));
  }
  void require_picture() const {
    if (width == 0) throw UsageError("There is no picture yet: call Tracer::render() first");
  }
  // Of calls from what watches a picture: they would use what it is being made with.
  void require_idle() const {
    if (!rendering) return;
    throw UsageError(
        "The tracer is rendering: call it after that, not from what hears the share that is done");
  }
  // Marks the tracer as rendering while it lives.
  struct Rendering {
    explicit Rendering(Impl& impl) : flag(impl.rendering) {
      impl.require_idle();
      flag = true;
    }
    ~Rendering() { flag = false; }
    Rendering(const Rendering&) = delete;
    Rendering& operator=(const Rendering&) = delete;
    bool& flag;
  };
  void trace_batch(const DeviceGaussians& gaussians, std::size_t first, std::size_t count);
  RaysGradients backward(const DeviceGaussians& gaussians,
                         std::span<const RayBackward::ResultGradient> gradients,
                         const std::function<bool(double)>& within);

  Context& context;
  TraceOptions options;
  bool mirrors;
  ViewTracer views;
  RayTracer tracer;
  RayBackward sums;
  std::optional<NormalPictures> normals;  // once they are wanted
  bool rendering = false;
  // The last picture.
  int width = 0;
  int height = 0;
  // The last rays.
  std::vector<Ray> rays;
  ColorDirection direction = ColorDirection::kRay;
  std::uint64_t revision = 0;  // of the model that they met; 0 = not differentiable
  Buffer<Ray> device_rays;
  Buffer<RayResult> results;
  std::uint64_t capped = 0;
  bool last_was_picture = true;
  // Of backward().
  GaussianGradients gradients;
  Buffer<float> image_gradient;
  Buffer<RayBackward::ResultGradient> result_gradients;
  Buffer<RayBackward::PaddedRayGradient> ray_gradients;
};

Tracer::Tracer(Context& context, const TraceOptions& options, Mirrors mirrors) {
  const auto lock = context.lock();
  impl_ = std::make_unique<Impl>(context, options, std::move(mirrors));
}
Tracer::~Tracer() = default;
Tracer::Tracer(Tracer&&) noexcept = default;
Tracer& Tracer::operator=(Tracer&&) noexcept = default;

Image Tracer::render(const Model& model,
                     const Camera& camera,
                     bool differentiable,
                     const std::function<bool(double)>& within) {
  Impl& self = *impl_;
  const auto lock = self.context.lock();
  const Impl::Rendering rendering(self);
  self.width = self.height = 0;
  const Watch watch(self.views, within);
  try {
    self.views.forward(gaussians_of(model, self.context), camera, differentiable);
  } catch (const Error&) {
    if (!watch.stopped()) throw;
    return {};
  }
  self.width = camera.width;
  self.height = camera.height;
  self.last_was_picture = true;
  return self.views.download_image();
}

void Tracer::set_share(std::size_t part, std::size_t parts) {
  const auto lock = impl_->context.lock();
  impl_->views.set_share(part, parts);
}

std::array<int, 2> Tracer::rows() const {
  const auto turn = impl_->context.lock();
  return impl_->views.rows();
}

Image Tracer::depth() const {
  const Impl& self = *impl_;
  const auto lock = self.context.lock();
  self.require_picture();
  return self.views.download_depth();
}

Image Tracer::normals(const Model& model,
                      const Camera& camera,
                      const std::function<bool(double)>& within) {
  Impl& self = *impl_;
  const auto lock = self.context.lock();
  const Impl::Rendering rendering(self);
  if (self.mirrors)
    throw UsageError("A picture with mirrors has no single normal: leave out the mirrors");
  if (!self.normals) self.normals.emplace(self.context, self.options);
  bool stopped = false;
  try {
    return self.normals->draw(gaussians_of(model, self.context), camera, [&](double share) {
      stopped = within && !within(share);
      return !stopped;
    });
  } catch (const Error&) {
    if (!stopped) throw;
    return {};
  }
}

ViewGradients Tracer::backward(const Model& model, const Image& gradient) {
  Impl& self = *impl_;
  const auto lock = self.context.lock();
  self.require_idle();
  const DeviceGaussians& gaussians = gaussians_of(model, self.context);
  self.require_picture();
  if (gradient.width != self.width || gradient.height != self.height || gradient.channels != 4) {
    throw UsageError(
        fmt::format("The gradient of a picture of {} x {} pixels and 4 channels has {} x {} and "
                    "{}: give one of "
                    "the picture's size",
                    self.width, self.height, gradient.width, gradient.height, gradient.channels));
  }
  if (gradient.data.size() != 4 * gradient.pixels()) {
    throw UsageError(fmt::format(
        "The gradient of a picture of {} x {} pixels has {} numbers: give {}, 4 for every pixel",
        self.width, self.height, gradient.data.size(), 4 * gradient.pixels()));
  }
  if (!std::all_of(gradient.data.begin(), gradient.data.end(),
                   [](float value) { return std::isfinite(value); })) {
    throw UsageError("The gradient of the picture has a number that is not finite: check the loss");
  }
  self.image_gradient.ensure(self.context, gradient.data.size(), "image gradient");
  self.image_gradient.upload(planes_of(gradient));
  ViewGradients out;
  const bool known_pose = !self.mirrors && self.options.sky.empty();
  if (!known_pose) {
    const double unknown = std::numeric_limits<double>::quiet_NaN();
    out.pose.center.fill(unknown);
    out.pose.rotation.fill(unknown);
  }
  self.views.backward(gaussians, self.image_gradient, self.gradients,
                      known_pose ? &out.pose : nullptr);
  out.parameters = downloaded(self.gradients, gaussians.sh_degree);
  if (const Sky* sky = self.views.sky()) out.sky = sky->download_gradient();
  return out;
}

void Tracer::Impl::trace_batch(const DeviceGaussians& gaussians,
                               std::size_t first,
                               std::size_t count) {
  device_rays.ensure(context, count, "rays");
  device_rays.upload(std::span<const Ray>(rays).subspan(first, count));
  tracer.trace(gaussians, device_rays, count, results, direction);
}

std::vector<RayResult> Tracer::trace(const Model& model,
                                     std::span<const Ray> rays,
                                     ColorDirection direction,
                                     bool differentiable,
                                     const std::function<bool(double)>& within) {
  Impl& self = *impl_;
  const auto lock = self.context.lock();
  const Impl::Rendering rendering(self);
  const DeviceGaussians& gaussians = gaussians_of(model, self.context);
  self.require_bare_rays();
  std::vector<Ray> sound;
  sound.reserve(rays.size());
  for (std::size_t i = 0; i < rays.size(); ++i) sound.push_back(checked(rays[i], i));
  self.revision = 0;
  self.last_was_picture = false;
  self.capped = 0;
  self.rays = std::move(sound);
  self.direction = direction;
  std::vector<RayResult> out(self.rays.size());
  self.tracer.follow(gaussians);
  self.tracer.set_background(self.options.background);
  RayWatch watch(self.tracer, self.sums, false, out.size(), within);
  try {
    for (std::size_t first = 0; first < out.size(); first += self.batch()) {
      const std::size_t count = std::min(self.batch(), out.size() - first);
      watch.begin_batch(first, count);
      self.trace_batch(gaussians, first, count);
      self.results.download(std::span<RayResult>(out).subspan(first, count));
    }
  } catch (const Stopped&) {
    self.rays.clear();
    return {};
  }
  for (const RayResult& result : out) self.capped += result.capped;
  if (differentiable) {
    self.revision = gaussians.revision;
  } else {
    self.rays.clear();
  }
  return out;
}

void trace(Tracer& tracer,
           const Model& model,
           cl_mem rays,
           std::size_t count,
           cl_mem results,
           ColorDirection direction) {
  Tracer::Impl& self = tracer.impl();
  const auto turn = self.context.lock();
  self.require_idle();
  const DeviceGaussians& gaussians = gaussians_of(model, self.context);
  self.require_bare_rays();
  check_foreign(self.context, rays, count * sizeof(Ray), "the rays");
  check_foreign(self.context, results, count * sizeof(RayResult), "the results");
  self.revision = 0;
  self.last_was_picture = false;
  self.capped = 0;
  self.device_rays.ensure(self.context, count, "rays");
  self.results.ensure(self.context, count, "ray results");
  copy_in(self.context, rays, self.device_rays.raw(), count * sizeof(Ray), "the rays");
  self.tracer.follow(gaussians);
  self.tracer.set_background(self.options.background);
  self.tracer.trace(gaussians, self.device_rays, count, self.results, direction);
  copy_out(self.context, self.results.raw(), results, count * sizeof(RayResult), "the results");
}

RaysGradients Tracer::backward(const Model& model,
                               std::span<const RayResultGradient> gradients,
                               const std::function<bool(double)>& within) {
  Impl& self = *impl_;
  const auto lock = self.context.lock();
  const Impl::Rendering rendering(self);
  const DeviceGaussians& gaussians = gaussians_of(model, self.context);
  if (self.revision == 0 || self.revision != gaussians.revision) {
    throw UsageError(
        "Tracer::backward() must follow trace(differentiable = true) of the same model, unchanged");
  }
  if (gradients.size() != self.rays.size()) {
    throw UsageError(
        fmt::format("There are {} gradients for the {} rays that were traced: give one for each",
                    gradients.size(), self.rays.size()));
  }
  std::vector<RayBackward::ResultGradient> numbers(gradients.size());
  for (std::size_t i = 0; i < gradients.size(); ++i) {
    const RayResultGradient& g = gradients[i];
    if (!finite(g.color) || !std::isfinite(g.alpha)) {
      throw UsageError(
          fmt::format("The gradient of ray {} has a number that is not finite: check the loss", i));
    }
    numbers[i] = {g.color[0], g.color[1], g.color[2], g.alpha};
  }
  try {
    return self.backward(gaussians, numbers, within);
  } catch (const Stopped&) {
    return {};
  }
}

RaysGradients Tracer::Impl::backward(const DeviceGaussians& gaussians,
                                     std::span<const RayBackward::ResultGradient> of_rays,
                                     const std::function<bool(double)>& within) {
  RaysGradients out;
  out.rays.resize(rays.size());
  sums.begin(gaussians, {}, rays.size());
  RayWatch watch(tracer, sums, true, rays.size(), within);
  std::vector<RayBackward::PaddedRayGradient> host_gradients;
  for (std::size_t first = 0; first < rays.size(); first += batch()) {
    const std::size_t count = std::min(batch(), rays.size() - first);
    watch.begin_batch(first, count);
    if (count < rays.size()) trace_batch(gaussians, first, count);
    result_gradients.ensure(context, count, "ray gradients");
    result_gradients.upload(of_rays.subspan(first, count));
    sums.add(gaussians, device_rays, count, results, result_gradients, direction, &ray_gradients);
    host_gradients.resize(count);
    ray_gradients.download(std::span<RayBackward::PaddedRayGradient>(host_gradients));
    for (std::size_t i = 0; i < count; ++i) {
      const RayBackward::PaddedRayGradient& s = host_gradients[i];
      out.rays[first + i] = {{s[0], s[1], s[2]}, {s[4], s[5], s[6]}};
    }
  }
  sums.finish(gaussians, gradients);
  out.parameters = downloaded(gradients, gaussians.sh_degree);
  return out;
}

std::uint64_t Tracer::capped_rays() const {
  const Impl& self = *impl_;
  const auto lock = self.context.lock();
  if (!self.last_was_picture) return self.capped;
  return self.width == 0 ? 0 : self.views.capped_rays();
}

std::uint64_t Tracer::reflected_rays() const {
  const Impl& self = *impl_;
  const auto lock = self.context.lock();
  return self.last_was_picture && self.width > 0 ? self.views.reflected_rays() : 0;
}

const TraceOptions& Tracer::options() const { return impl_->options; }

const Context& Tracer::context() const { return impl_->context; }

void Tracer::set_background(const std::array<float, 3>& background, const SkyLight& sky) {
  Impl& self = *impl_;
  const auto lock = self.context.lock();
  self.views.set_background(background, sky);
  self.options.background = background;
  self.options.sky = sky;
}

}  // namespace raysplats
