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

#include "device/kernel.hpp"
#include "light/first_hit_tracer.hpp"
#include "light/path_memory.hpp"
#include "light/surface_store.hpp"
#include "parallel/scan.hpp"
#include "raysplats/error.hpp"
#include "scene/camera_check.hpp"
#include "scene/gaussian_check.hpp"
#include "scene/pixel_count.hpp"
#include "scene/pixel_places.hpp"
#include "scene/render_option_table.hpp"
#include "scene/row_share.hpp"
#include "scene/shadow_bias.hpp"
#include "trace/camera_rays.hpp"
#include "trace/camera_tracer.hpp"
#include "trace/model_impl.hpp"
#include "trace/ray_launch.hpp"
#include "trace/ray_tracer.hpp"

namespace raysplats {
namespace {

constexpr const char* kProgram = "light/path_tracer.cl";
constexpr std::size_t kGroup = 64;
constexpr std::size_t kTallyChunk = 1024;
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

// Leaves packets without a watch when it goes, whatever was thrown in between: what a watch refers
// to ends before they do.
class Unwatched {
 public:
  explicit Unwatched(CameraTracer& packets) : packets_(packets) {}
  ~Unwatched() { packets_.set_watch({}); }
  Unwatched(const Unwatched&) = delete;
  Unwatched& operator=(const Unwatched&) = delete;

 private:
  CameraTracer& packets_;
};

// What a watch ends a picture with.
struct Stopped {};

}  // namespace

struct PathTracer::Impl {
  Impl(Context& context_in, const Scene& scene)
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

  void render(const Camera& camera, const std::function<bool(double)>& within, Image& out);
  PathTracer::FirstHits first_hits(const Camera& camera, const std::function<bool(double)>& within);
  std::optional<glm::dvec3> first_point(const Camera& camera);

  Kernel kernel(const char* name) { return context.kernel(kProgram, name); }
  /// Whether lens and rough mirrors are sampled: one sample alone stays sharp.
  bool scatters() const { return of_many || settings.samples > 1; }
  RsWave wave_record(std::uint32_t sample, std::size_t first_pixel) const;
  void trace_sample(const Camera& camera,
                    std::uint32_t sample,
                    std::size_t first,
                    std::size_t count,
                    std::size_t first_sum);
  std::size_t trace_wave(const RsWave& wave, std::size_t count, std::size_t first_sum);
  bool light_on_gaussians();
  bool by_packets(const Camera& camera);
  void trace_packets(const Camera& camera, const std::function<void()>& watch);
  void take_packets(const RsWave& wave, std::size_t count);
  void gather_light(const RsWave& wave, std::size_t count, bool from_gaussians);
  // RS_LIT_ARGUMENTS of cl/light/path_tracer.cl.
  auto lit_arguments() const {
    return argument_pack(surfaces.lights(), surfaces.materials(), rays, results, met);
  }
  void add_tallies(std::size_t count);

  Context& context;
  RenderSettings settings;
  bool of_many = false;  // set_sampling()
  PathMemory memory;
  TraceOptions options;
  DeviceGaussians gaussians;
  RayTracer tracer;
  std::optional<CameraTracer> packets;  // once they are wanted
  std::optional<FirstHitTracer> first;
  bool packet_depth = false;
  std::size_t packet_pixels = 0;  // of the picture that they have traced; 0 = none
  std::array<float, 4> packet_axis{};
  std::size_t part = 0, parts = 1;  // set_share()
  std::array<int, 2> rows{};        // of the last picture, that were drawn
  SurfaceStore surfaces;
  std::vector<Light> lights;
  CameraRays camera_rays;
  Scan scan;
  float bias = 0;
  Statistics statistics;

  Buffer<Ray> rays, next_rays, shadow_rays;
  Buffer<RsPath> paths, next_paths;
  Buffer<RsSurfaceHit> hits;
  Buffer<RsSurface> met;
  Buffer<RayResult> results, blocked;
  Buffer<std::int32_t> skip;
  Buffer<std::uint32_t> from_origin;
  Buffer<float> passes;
  Buffer<std::array<float, 4>> gaussian_light;
  Buffer<std::array<float, 8>> surface_light;
  Buffer<std::array<float, 4>> gained, sums;
  Buffer<std::uint32_t> offsets;
  Buffer<std::array<std::uint32_t, 4>> tallies, partials;
};

RsWave PathTracer::Impl::wave_record(std::uint32_t sample, std::size_t first_pixel) const {
  RsWave wave{};
  wave.seed_lo = static_cast<std::uint32_t>(settings.seed);
  wave.seed_hi = static_cast<std::uint32_t>(settings.seed >> 32);
  wave.sample = sample;
  wave.scatter = scatters() ? 1 : 0;
  wave.max_bounces = settings.max_bounces;
  wave.min_throughput = settings.min_throughput;
  wave.indirect = settings.indirect ? 1 : 0;
  std::copy(settings.ambient.begin(), settings.ambient.end(), wave.ambient);
  wave.strength = settings.shadows.strength;
  wave.bias = bias;
  wave.lights = static_cast<std::int32_t>(lights.size());
  wave.light_samples = settings.light_samples;
  wave.first_pixel = u32(first_pixel);
  return wave;
}

void PathTracer::Impl::trace_sample(const Camera& camera,
                                    std::uint32_t sample,
                                    std::size_t first,
                                    std::size_t count,
                                    std::size_t first_sum) {
  Lens lens;
  lens.sample = sample;
  lens.seed = settings.seed;
  lens.aperture = scatters() ? settings.aperture : 0.0f;
  lens.focus_distance = settings.focus_distance;
  camera_rays.generate(camera, lens, first, count, rays);
  paths.ensure(context, count, "paths");
  kernel("begin_paths")
      .launch(Range::linear(count, kGroup), u32(count),
              camera.model == CameraModel::kOrthographic ? 0 : 1, rays, paths);
  RsWave wave = wave_record(sample, first);
  statistics.camera_rays += count;
  for (std::size_t live = count; live > 0; ++wave.bounce) {
    live = trace_wave(wave, live, first_sum);
    statistics.continued_rays += live;
  }
}

std::size_t PathTracer::Impl::trace_wave(const RsWave& wave,
                                         std::size_t count,
                                         std::size_t first_sum) {
  const Range each = Range::linear(count, kGroup);
  hits.ensure(context, count, "surface hits");
  met.ensure(context, count, "surfaces");
  from_origin.ensure(context, count, "colour directions");
  gaussian_light.ensure(context, count, "light on Gaussians");
  surface_light.ensure(context, count, "light on surfaces");
  gained.ensure(context, count, "light of paths");
  tallies.ensure(context, count, "tallies");
  offsets.ensure(context, count + 1, "path offsets");
  next_paths.ensure(context, 2 * count, "paths that go on");
  next_rays.ensure(context, 2 * count, "rays that go on");

  surfaces.triangles().nearest(rays, paths, count, hits);
  kernel("load_surfaces")
      .launch(each, u32(count), hits, surfaces.vertices(), surfaces.triangle_materials(),
              surfaces.materials(), surfaces.textures(), surfaces.texels(), paths, rays,
              from_origin, met);
  if (wave.bounce == 0 && packet_pixels > 0) {
    take_packets(wave, count);
  } else {
    tracer.trace(gaussians, rays, from_origin, count, results);
  }
  gaussian_light.clear(count);
  surface_light.clear(count);
  if (light_on_gaussians()) gather_light(wave, count, true);
  if (surfaces.lit()) gather_light(wave, count, false);
  kernel("advance").launch(each, u32(count), wave, surfaces.materials(), surfaces.environment(),
                           surfaces.environment_picture(), paths, rays, results, met,
                           gaussian_light, surface_light, gained, offsets, next_paths, next_rays,
                           tallies);
  kernel("accumulate").launch(each, u32(count), u32(first_sum), paths, gained, sums);
  add_tallies(count);
  scan.exclusive(offsets, count);
  const std::size_t live = offsets.read(count);
  paths.ensure(context, live, "paths");
  rays.ensure(context, live, "rays");
  if (live > 0) {
    kernel("gather_paths").launch(each, u32(count), offsets, next_paths, next_rays, paths, rays);
  }
  return live;
}

bool PathTracer::Impl::light_on_gaussians() {
  const ShadowSettings& shadows = settings.shadows;
  const bool wanted = (shadows.mesh_on_gaussians && surfaces.triangles().size() > 0) ||
                      shadows.gaussians_on_gaussians;
  return wanted && shadows.strength > 0 && gaussians.count > 0 && !lights.empty();
}

// Rays of one sample that leave the centre of a camera share what they meet. Lights on Gaussians
// need depths along rays, and Gaussians that shade others the leading one of every ray.
bool PathTracer::Impl::by_packets(const Camera& camera) {
  if (!memory.packets(pixel_count(camera)) || gaussians.count == 0 ||
      walks_tree(options, context.device()))
    return false;
  const bool lit = light_on_gaussians();
  if (lit && settings.shadows.gaussians_on_gaussians) return false;
  if (!packets || packet_depth != lit) {
    TraceOptions with_depth = options;
    with_depth.depth = packet_depth = lit;
    packets.emplace(context, with_depth);
    packets->update(gaussians);
  }
  return packets->traces(camera);
}

// The picture of the Gaussians alone.
void PathTracer::Impl::trace_packets(const Camera& camera, const std::function<void()>& watch) {
  const Unwatched afterwards(*packets);
  if (watch) packets->set_watch([&watch](double) { watch(); });
  packets->forward(gaussians, camera);
  statistics.capped_rays += packets->statistics().capped_rays;
  packet_pixels = pixel_count(camera);
  packet_axis = depth_axis(camera);
}

// Camera rays that meet no surface from the packets' picture, the others ray by ray.
void PathTracer::Impl::take_packets(const RsWave& wave, std::size_t count) {
  const Range each = Range::linear(count, kGroup);
  results.ensure(context, count, "ray results");
  if (surfaces.triangles().size() > 0) {
    shadow_rays.ensure(context, count, "shadow rays");
    kernel("rays_to_surfaces").launch(each, u32(count), met, rays, shadow_rays);
    tracer.trace(gaussians, shadow_rays, from_origin, count, results);
  }
  kernel("results_of_picture")
      .launch(each, u32(count), wave.first_pixel, u32(packet_pixels), packets->image(), met,
              results);
  if (packet_depth) {
    kernel("depths_of_picture")
        .launch(each, u32(count), wave.first_pixel, u32(packet_pixels), packet_axis,
                packets->depth(), met, rays, results);
  }
}

void PathTracer::Impl::gather_light(const RsWave& wave, std::size_t count, bool from_gaussians) {
  const Range each = Range::linear(count, kGroup);
  const ShadowSettings& shadows = settings.shadows;
  const bool use_triangles = shadows.strength > 0 && surfaces.triangles().size() > 0 &&
                             (from_gaussians ? shadows.mesh_on_gaussians : shadows.mesh_on_mesh);
  const bool use_gaussians =
      shadows.strength > 0 && gaussians.count > 0 &&
      (from_gaussians ? shadows.gaussians_on_gaussians : shadows.gaussians_on_mesh);
  shadow_rays.ensure(context, count, "shadow rays");
  skip.ensure(context, count, "triangles to skip");
  passes.ensure(context, count, "light that passes");
  blocked.ensure(context, count, "light that Gaussians take");
  const int kind = from_gaussians ? 1 : 0;
  const auto make_rays = [&](int light, int k, int target) {
    kernel("shadow_rays")
        .launch(each, u32(count), wave, light, k, target, lit_arguments(), gaussians.quaternions,
                gaussians.scales, tracer.options().quantile, paths, shadow_rays, skip);
  };
  for (std::size_t number = 0; number < lights.size(); ++number) {
    const bool soft = lights[number].kind == Light::Kind::kSphere && lights[number].radius > 0;
    const int samples = soft && (use_triangles || use_gaussians) ? settings.light_samples : 1;
    const int light = static_cast<int>(number);
    for (int k = 0; k < samples; ++k) {
      make_rays(light, k, kind);
      if (use_triangles) {
        surfaces.triangles().light_through(shadow_rays, skip, surfaces.triangle_shadows(), count,
                                           passes);
      }
      if (use_gaussians) {
        if (from_gaussians) make_rays(light, k, 2);
        tracer.trace(gaussians, shadow_rays, count, blocked);
      }
      kernel("add_light")
          .launch(each, u32(count), wave, light, 1.0f / static_cast<float>(samples), kind,
                  use_triangles ? 1 : 0, use_gaussians ? 1 : 0, lit_arguments(), shadow_rays,
                  passes, blocked, gaussian_light, surface_light);
    }
  }
}

void PathTracer::Impl::add_tallies(std::size_t count) {
  const std::size_t chunks = (count + kTallyChunk - 1) / kTallyChunk;
  partials.ensure(context, chunks, "tally sums");
  kernel("sum_tallies")
      .launch(Range::linear(chunks, 1), u32(count), u32(kTallyChunk), tallies, partials);
  for (const std::array<std::uint32_t, 4>& part : partials.download()) {
    statistics.shadow_rays += part[0];
    statistics.capped_rays += part[1];
    statistics.ended_by_bounces += part[2];
  }
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
  tracer.trace(gaussians, rays, 1, results);
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
