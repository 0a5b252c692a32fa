// SPDX-License-Identifier: Apache-2.0
#include "raysplats/path_tracer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <optional>
#include <span>

#include "light/path_tracer_impl.hpp"
#include "raysplats/error.hpp"
#include "scene/camera/camera_check.hpp"
#include "scene/gaussians/gaussian_check.hpp"
#include "scene/image/pixel_count.hpp"
#include "scene/image/pixel_places.hpp"
#include "scene/image/row_share.hpp"
#include "scene/mesh/shadow_bias.hpp"
#include "scene/options/render_option_table.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kWatchedBatch = std::size_t{1} << 16;  // rays between two looks at the watch

// Without what belongs to a camera's view.
TraceOptions ray_options(TraceOptions options) {
  options.background = {0, 0, 0};
  options.sky.clear();     // the scene's environment has it
  options.near_depth = 0;  // rays that leave a mirror have no camera that could be near
  return options;
}

void check(const std::vector<Light>& lights) {
  for (std::size_t i = 0; i < lights.size(); ++i) {
    const Light& light = lights[i];
    float sum = light.radius;
    for (std::size_t k = 0; k < 3; ++k) {
      sum += light.position[k] + light.direction[k] + light.color[k];
    }
    if (!std::isfinite(sum)) {
      throw UsageError(fmt::format("Light {} has a number that is not finite: correct it", i));
    }
  }
}

PathMemory memory_of(const Scene& scene, const DeviceInfo& device) {
  PathMemory memory(scene, device);
  memory.check(0);
  return memory;
}

// What a watch ends a picture with.
struct Stopped {};

}  // namespace

PathTracer::Impl::Impl(Context& context_in, const Scene& scene)
    : context(context_in),
      settings((check_render_settings(scene.render), scene.render)),
      memory(memory_of(scene, context_in.device())),
      options(ray_options(scene.trace)),
      gaussians(DeviceGaussians::upload(context_in, scene.gaussians, ScaleActivation::kExp)),
      tracer(context_in, options),
      surfaces(context_in, scene),
      lights(scene.lights),
      camera_rays(context_in),
      scan(context_in),
      bias(shadow_bias(scene)) {
  tracer.update(gaussians);
}

PathTracer::PathTracer(Context& context, const Scene& scene) {
  check_gaussians(scene.gaussians);
  check(scene.lights);
  const auto turn = context.lock();
  impl_ = std::make_unique<Impl>(context, scene);
}
PathTracer::~PathTracer() = default;
PathTracer::PathTracer(PathTracer&&) noexcept = default;
PathTracer& PathTracer::operator=(PathTracer&&) noexcept = default;

void PathTracer::set_meshes(const std::vector<Mesh>& meshes) {
  const auto turn = impl_->context.lock();
  std::size_t triangles = 0;
  for (const Mesh& mesh : meshes) triangles += mesh.triangle_count();
  impl_->memory.set_meshes(triangles);
  impl_->memory.check(0);
  impl_->surfaces.set_meshes(meshes);
}

Image PathTracer::render(const Camera& camera, const std::function<bool(double)>& within) {
  const auto turn = impl_->context.lock();
  require_pixels(camera);
  Image out(camera.width, camera.height, 4);
  impl_->memory.check(out.pixels());
  try {
    impl_->render(camera, within, out);
  } catch (const Stopped&) {
    return Image();
  }
  return out;
}

PathTracer::FirstHits PathTracer::first_hits(const Camera& camera,
                                             const std::function<bool(double)>& within) {
  const auto turn = impl_->context.lock();
  require_pixels(camera);
  return impl_->first_hits(camera, within);
}

PathTracer::FirstHits PathTracer::Impl::first_hits(const Camera& camera,
                                                   const std::function<bool(double)>& within) {
  const std::size_t pixels = pixel_count(camera);
  const std::size_t batch = std::min(memory.batch(), within ? kWatchedBatch : pixels);
  if (!first) first.emplace(context, options);
  PathTracer::FirstHits out{Image(camera.width, camera.height, 3),
                            Image(camera.width, camera.height, 3),
                            Image(camera.width, camera.height, 1)};
  for (std::size_t begin = 0; begin < pixels; begin += batch) {
    const std::size_t count = std::min(batch, pixels - begin);
    const std::vector<RayResult> part = first->trace(gaussians, surfaces, camera, begin, count);
    for (std::size_t i = 0; i < count; ++i) {
      const RayResult& result = part[i];
      const std::array<float, 3> depth{result.expected_depth, result.median_depth,
                                       static_cast<float>(result.hits)};
      std::copy_n(depth.begin(), 3, &out.depth.data[3 * (begin + i)]);
      std::copy_n(&result.color[0], 3, &out.normals.data[3 * (begin + i)]);
      out.alpha.data[begin + i] = result.alpha;
    }
    const double share = static_cast<double>(begin + count) / static_cast<double>(pixels);
    if (within && !within(share)) return {};
  }
  return out;
}

std::optional<glm::dvec3> PathTracer::first_point(const Camera& camera) {
  const auto turn = impl_->context.lock();
  require_pixels(camera);
  return impl_->first_point(camera);
}

std::optional<glm::dvec3> PathTracer::Impl::first_point(const Camera& camera) {
  const auto width = static_cast<std::size_t>(camera.width);
  const std::size_t middle = width * (static_cast<std::size_t>(camera.height) / 2) + width / 2;
  camera_rays.generate(camera, Lens(), middle, 1, rays);
  surfaces.triangles().nearest(rays, 1, hits);
  camera_rays.cones(camera, options.view_footprint, rays, 1, cones);
  tracer.trace(gaussians, rays, 1, results, ColorDirection::kRay, cones_of_rays());
  const RsSurfaceHit surface = hits.read(0);
  const float cloud = results.read(0).median_depth;
  float depth = std::numeric_limits<float>::infinity();
  if (surface.triangle >= 0) depth = surface.t;
  if (cloud > 0) depth = std::min(depth, cloud);
  if (!std::isfinite(depth)) return std::nullopt;
  const Ray ray = rays.read(0);
  glm::dvec3 point;
  for (int k = 0; k < 3; ++k)
    point[k] = static_cast<double>(ray.origin[k]) + static_cast<double>(depth) * ray.direction[k];
  return point;
}

// Packets trace a sample of all its rows at once; without them a batch of pixels gets all its
// samples before the next one.
void PathTracer::Impl::render(const Camera& camera,
                              const std::function<bool(double)>& within,
                              Image& out) {
  const bool at_once = by_packets(camera);
  if (at_once) packets->set_share(part, parts);
  // Packets draw whole tiles.
  rows = at_once ? packets->shared_rows(camera.height) : share_of_rows(camera.height, part, parts);
  const auto width = static_cast<std::size_t>(camera.width);
  const std::size_t top = width * static_cast<std::size_t>(rows[0]);
  const std::size_t bottom = width * static_cast<std::size_t>(rows[1]);
  const std::size_t batch = memory.batch();
  const std::size_t step = at_once ? bottom - top : std::min(batch, bottom - top);
  const auto samples = static_cast<std::size_t>(settings.samples);
  statistics = {};
  std::size_t done = 0;  // rays
  std::function<void()> watch;
  if (within) {
    watch = [&] {
      const double share =
          static_cast<double>(done) / static_cast<double>(samples * (bottom - top));
      if (!within(share)) throw Stopped();
    };
  }
  for (std::size_t begin = top; begin < bottom; begin += step) {
    const std::size_t end = std::min(begin + step, bottom);
    sums.ensure(context, step, "pixel sums");
    sums.clear(end - begin);
    for (std::size_t sample = 0; sample < samples; ++sample) {
      const Camera view = moved_in_pixels(camera, pixel_place(sample, samples, settings.seed));
      packet_pixels = 0;
      if (at_once && by_packets(view)) trace_packets(view, watch);
      for (std::size_t first = begin; first < end; first += batch) {
        const std::size_t count = std::min(batch, end - first);
        trace_sample(view, u32(sample), first, count, first - begin);
        done += count;
        if (watch) watch();
      }
    }
    std::vector<std::array<float, 4>> gathered(end - begin);
    sums.download(std::span<std::array<float, 4>>(gathered));
    const auto divisor = static_cast<float>(samples);
    for (std::size_t i = begin; i < end; ++i) {
      const std::array<float, 4>& sum = gathered[i - begin];
      float* pixel = out.data.data() + 4 * i;
      for (std::size_t c = 0; c < 3; ++c) pixel[c] = sum[c] / divisor;
      pixel[3] = 1.0f - sum[3] / divisor;
    }
  }
}

void PathTracer::set_share(std::size_t part, std::size_t parts) {
  const auto turn = impl_->context.lock();
  impl_->part = part;
  impl_->parts = parts;
}

std::array<int, 2> PathTracer::rows() const {
  const auto turn = impl_->context.lock();
  return impl_->rows;
}

void PathTracer::set_sampling(int samples, std::uint64_t seed, bool of_many) {
  const auto turn = impl_->context.lock();
  RenderSettings settings = impl_->settings;
  settings.samples = samples;
  settings.seed = seed;
  check_render_settings(settings);
  impl_->settings = settings;
  impl_->of_many = of_many;
  impl_->memory.set_render(settings, of_many);
}

const Context& PathTracer::context() const { return impl_->context; }

PathTracer::Statistics PathTracer::statistics() const {
  const auto turn = impl_->context.lock();
  return impl_->statistics;
}

}  // namespace raysplats
