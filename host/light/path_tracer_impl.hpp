// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "device/kernel.hpp"
#include "light/first_hit_tracer.hpp"
#include "light/path_memory.hpp"
#include "light/surface_store.hpp"
#include "parallel/scan.hpp"
#include "raysplats/path_tracer.hpp"
#include "trace/camera_rays.hpp"
#include "trace/camera_tracer.hpp"
#include "trace/ray_launch.hpp"
#include "trace/ray_tracer.hpp"

namespace raysplats {

/// Pictures are in path_tracer.cpp, the waves of paths that they are made of in path_waves.cpp.
struct PathTracer::Impl {
  Impl(Context& context_in, const Scene& scene);

  void render(const Camera& camera, const std::function<bool(double)>& within, Image& out);
  PathTracer::FirstHits first_hits(const Camera& camera, const std::function<bool(double)>& within);
  std::optional<glm::dvec3> first_point(const Camera& camera);

  Kernel kernel(const char* name);
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
  float footprint() const;
  const Buffer<RsCone>* cones_of_rays() const { return has_cones(options) ? &cones : nullptr; }
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
  float packet_footprint = 0;
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
  Buffer<RsCone> cones;
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

}  // namespace raysplats
