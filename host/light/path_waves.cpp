// SPDX-License-Identifier: Apache-2.0
// One sample of a batch of pixels: all its paths advance by one surface at a time.
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>

#include "device/kernel.hpp"
#include "light/path_tracer_impl.hpp"
#include "scene/image/pixel_count.hpp"

namespace raysplats {
namespace {

constexpr const char* kProgram = "light/path_tracer.cl";
constexpr std::size_t kGroup = 64;
constexpr std::size_t kTallyChunk = 1024;

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

}  // namespace

Kernel PathTracer::Impl::kernel(const char* name) { return context.kernel(kProgram, name); }

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
  camera_rays.cones(camera, footprint(), rays, count, cones);
  paths.ensure(context, count, "paths");
  kernel("begin_paths")
      .launch(Range::linear(count, kGroup), u32(count),
              camera.model == CameraModel::kOrthographic ? 0 : 1, rays, cones, paths);
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
  cones.ensure(context, count, "cones of rays");
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
              from_origin, cones, met);
  if (wave.bounce == 0 && packet_pixels > 0) {
    take_packets(wave, count);
  } else {
    tracer.trace(gaussians, rays, from_origin, count, results, cones_of_rays());
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

// Rays of several samples are as much closer to each other.
float PathTracer::Impl::footprint() const {
  return options.view_footprint / std::sqrt(static_cast<float>(settings.samples));
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
  if (!packets || packet_depth != lit || packet_footprint != footprint()) {
    TraceOptions shown = options;
    shown.depth = packet_depth = lit;
    shown.view_footprint = packet_footprint = footprint();
    packets.emplace(context, shown);
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
    tracer.trace(gaussians, shadow_rays, from_origin, count, results, cones_of_rays());
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

}  // namespace raysplats
