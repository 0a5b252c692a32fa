// SPDX-License-Identifier: Apache-2.0
// What a path tracer says of the rays that max_hits stops.
#include <cstddef>
#include <cstdint>

#include "raysplats/path_tracer.hpp"
#include "unit/light/light_fixture.hpp"

using namespace raysplats;
using reference::rectangle;

TEST_CASE("rays that end on a surface count once where max_hits stops them") {
  Context context = make_test_context();
  Scene scene = cloud_scene();
  scene.trace.max_hits = 1;
  const auto counts = [&] {
    PathTracer tracer(context, scene);
    tracer.render(kCamera);
    return tracer.statistics();
  };
  const std::uint64_t capped = counts().capped_rays;
  CHECK(2 * capped > counts().camera_rays);
  add_mesh(scene, rectangle({-3, -3, 2}, {6, 0, 0}, {0, 6, 0}, 0), diffuse({0.7f, 0.2f, 0.4f}));
  // Packets know no wall, which all of the Gaussians are before.
  CHECK(counts().capped_rays == capped);
  scene.trace.traversal = Traversal::kBvh;
  CHECK(counts().capped_rays == capped);
}

TEST_CASE("rays to lights that max_hits stops are counted") {
  Context context = make_test_context();
  // The cloud stands above the picture, between the floor and the lamp.
  Scene scene = cloud_scene();
  for (std::size_t i = 0; i < scene.gaussians.size(); ++i) scene.gaussians.means[3 * i + 1] -= 4.0f;
  add_floor(scene);
  Light high = lamp();
  high.position = {0, -9, 0};
  scene.lights = {high};
  scene.render.shadows = {false, false, true, false, 1.0f};
  const auto counts = [&] {
    PathTracer tracer(context, scene);
    tracer.render(kCamera);
    return tracer.statistics();
  };
  CHECK(counts().capped_rays == 0);
  scene.trace.max_hits = 1;
  PathTracer::Statistics rays = counts();
  CHECK(rays.capped_rays > 0);
  CHECK(rays.capped_rays <= rays.shadow_rays);
  scene.render.shadows.gaussians_on_mesh = false;
  CHECK(counts().capped_rays == 0);
  // From Gaussians too, beside the camera's own rays.
  for (std::size_t i = 0; i < scene.gaussians.size(); ++i) scene.gaussians.means[3 * i + 1] += 4.0f;
  const std::uint64_t of_camera = counts().capped_rays;
  scene.render.shadows.gaussians_on_gaussians = true;
  rays = counts();
  CHECK(rays.capped_rays > of_camera);
  CHECK(rays.capped_rays <= rays.camera_rays + rays.shadow_rays);
}
