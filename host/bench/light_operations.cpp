// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <memory>

#include "bench/scene_state.hpp"
#include "light/work.h"
#include "synth/bench_scenes.hpp"
#include "trace/camera_rays.hpp"

namespace raysplats {
namespace {

// Size of the bodies, as a share of the model's smallest half extent.
constexpr double kBodySize = 0.5;
constexpr float kLightDistance = 3.0f;

}  // namespace

Mesh SceneBench::Impl::body(std::size_t triangles) const {
  const auto [center, half] = middle();
  return bench_body(triangles, center, kBodySize * *std::min_element(half.begin(), half.end()));
}

void SceneBench::Impl::make_triangles(std::size_t triangles, bool from_camera) {
  if (!triangle_tracer) triangle_tracer = std::make_unique<TriangleTracer>(context);
  const Mesh mesh = body(triangles);
  triangle_tracer->build({&mesh, 1});
  if (from_camera) {
    CameraRays(context).generate(model.camera, Lens{}, 0, static_cast<std::size_t>(pixels()),
                                 surface_rays);
    return;
  }
  make_rays();
  surface_rays.ensure(context, ray_list.size(), "benchmark rays");
  surface_rays.upload(ray_list);
}

BenchOperation SceneBench::Impl::surfaces(const char* row,
                                          std::size_t triangles,
                                          bool from_camera) {
  // The work is asked for when later rows have used the same tracer.
  const auto rays = std::make_shared<double>();
  return {[=, this] {
            make_triangles(triangles, from_camera);
            *rays = static_cast<double>(surface_rays.size());
          },
          {},
          [this] { triangle_tracer->nearest(surface_rays, surface_rays.size(), surface_hits); },
          {{row, {}, false, [rays] {
              return BenchWork{{{"rays", *rays}},
                               RS_WORK_SURFACE_RAY_BYTES * *rays,
                               RS_WORK_SURFACE_RAY_FLOPS * *rays};
            }}}};
}

void SceneBench::Impl::make_light_tracer(std::size_t triangles,
                                         Material::Kind kind,
                                         bool lights,
                                         int samples) {
  Scene scene;
  scene.render.samples = samples;
  scene.gaussians = model.gaussians;
  scene.trace = options.trace;
  Material material;
  material.kind = kind;
  scene.materials = {material};
  if (triangles > 0) scene.meshes.push_back(body(triangles));
  if (lights) {
    const auto [center, half] = middle();
    Light light;
    light.color = {10, 10, 10};
    for (std::size_t k = 0; k < 3; ++k) {
      light.position[k] = static_cast<float>(center[k]) +
                          (k == 2 ? -1.0f : 1.0f) * kLightDistance * static_cast<float>(half[k]);
    }
    scene.lights = {light};
  }
  light_tracer.reset();  // two do not fit where one does
  light_tracer = std::make_unique<PathTracer>(context, scene);
}

BenchOperation SceneBench::Impl::light(
    const char* row, std::size_t triangles, Material::Kind kind, bool lights, int samples) {
  const auto statistics = std::make_shared<PathTracer::Statistics>();
  return {[=, this] { make_light_tracer(triangles, kind, lights, samples); },
          {},
          [=, this] {
            light_tracer->render(model.camera);
            *statistics = light_tracer->statistics();
          },
          {{row, {}, false, [statistics] {
              const PathTracer::Statistics& s = *statistics;
              const auto paths = static_cast<double>(s.camera_rays + s.continued_rays);
              const auto shadows = static_cast<double>(s.shadow_rays);
              BenchWork work{{{"rays", paths + shadows}},
                             RS_WORK_PATH_BYTES * paths + RS_WORK_SHADOW_RAY_BYTES * shadows,
                             RS_WORK_SURFACE_RAY_FLOPS * (paths + shadows)};
              if (shadows > 0) work.items.push_back({"shadow rays", shadows});
              return work;
            }}}};
}

}  // namespace raysplats
