// SPDX-License-Identifier: Apache-2.0
#include "render/scene_frames.hpp"

#include <chrono>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "comm/communicator.hpp"
#include "render/bands.hpp"
#include "render/previews.hpp"
#include "render/shutter.hpp"
#include "util/clock.hpp"

namespace raysplats {
namespace {

void add(PathTracer::Statistics& sum, const PathTracer::Statistics& frame) {
  sum.camera_rays += frame.camera_rays;
  sum.continued_rays += frame.continued_rays;
  sum.shadow_rays += frame.shadow_rays;
  sum.capped_rays += frame.capped_rays;
  sum.ended_by_bounces += frame.ended_by_bounces;
}

FrameLayers layers_of(PathTracer& tracer,
                      const Camera& camera,
                      const std::function<bool(double)>& within) {
  PathTracer::FirstHits first = tracer.first_hits(camera, within);
  if (first.alpha.data.empty()) return {};
  return {expected_of(first.depth), unit_normals(std::move(first.normals)), hits_of(first.depth),
          std::move(first.alpha)};
}

/// A frame, the mean of the moments at which the shutter is open; empty when it was stopped.
Image exposed(PathTracer& tracer,
              const LoadedScene& scene,
              std::size_t frame,
              const FrameOptions& options,
              PathTracer::Statistics& rays,
              const std::function<bool(double)>& within) {
  const RenderSettings& settings = scene.scene.render;
  const int moments = options.shutter_samples;
  Image sum;
  for (int k = 0; k < moments; ++k) {
    const double share = moment(options, k);
    if (scene.moves()) tracer.set_meshes(scene.meshes(static_cast<double>(frame) + share));
    // Moments that scatter alike would add up to one picture's noise.
    if (moments > 1) {
      tracer.set_sampling(settings.samples, settings.seed + static_cast<std::uint64_t>(k), true);
    }
    Image picture =
        tracer.render(camera_between(scene.cameras, frame, share, options.closed),
                      [&](double done) { return !within || within((k + done) / moments); });
    add(rays, tracer.statistics());
    if (picture.pixels() == 0) return {};
    add(sum, std::move(picture));
  }
  divide(sum, moments);
  return sum;
}

}  // namespace

SceneReport write_scene_frames(PathTracer& tracer,
                               const LoadedScene& scene,
                               std::size_t first,
                               std::size_t last,
                               const std::filesystem::path& folder,
                               const FrameOptions& options,
                               const std::function<bool(std::size_t)>& done,
                               const std::function<bool(double)>& within) {
  check_shutter(options);
  const std::vector<std::string> names = frame_names(scene.cameras);
  FrameWriter writer(folder, options);
  SceneReport report;
  Communicator alone;
  Communicator& ranks = options.bands != nullptr ? *options.bands : alone;
  tracer.set_share(static_cast<std::size_t>(ranks.rank()), static_cast<std::size_t>(ranks.size()));
  for (std::size_t i = first + options.offset; i < last; i += options.stride) {
    const double built = tracer.context().build_seconds();
    const auto start = std::chrono::steady_clock::now();
    Image rgba = exposed(tracer, scene, i, options, report.rays, within);
    report.trace_seconds += seconds_since(start) - (tracer.context().build_seconds() - built);
    if (ranks.all_reduce_or(rgba.pixels() == 0)) break;
    collect_rows(ranks, tracer.rows(), rgba);
    // What follows is left to the one that leads.
    if (ranks.leads()) {
      FrameLayers layers;
      if (options.depth || options.normals || options.hits) {
        if (scene.moves()) tracer.set_meshes(scene.meshes(static_cast<double>(i)));
        layers = layers_of(tracer, scene.cameras[i], within);
        if (layers.alpha.data.empty()) {
          ranks.all_reduce_or(true);
          break;
        }
      }
      writer.add(names[i], std::move(rgba), scene.cameras[i], std::move(layers));
      ++report.frames;
    }
    if (ranks.all_reduce_or(done && !done(report.frames))) break;
  }
  tracer.set_share(0, 1);
  tracer.set_sampling(scene.scene.render.samples, scene.scene.render.seed);
  writer.finish();
  return report;
}

}  // namespace raysplats
