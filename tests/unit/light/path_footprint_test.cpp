// SPDX-License-Identifier: Apache-2.0
// The footprint of pixels in scenes: packets and cones, surfaces, several samples.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "scene/image/pixel_places.hpp"
#include "unit/light/light_fixture.hpp"

using namespace raysplats;
using reference::ball;
using reference::cube_camera;
using reference::rectangle;
using reference::white;

TEST_CASE("pixels of scenes have a footprint, in mirrors and behind glass too") {
  Context context = make_test_context();
  Scene scene = cloud_scene(1);
  scene.trace = peak_order();
  scene.trace.view_footprint = 0.6f;
  for (float& scale : scene.gaussians.log_scales) scale -= 1.5f;
  add_mesh(scene, rectangle({0, 0.4, 0.9}, {1.2, 0, 0.3}, {0, 0.9, 0}, 0),
           white(Material::Kind::kMirror));
  add_mesh(scene, ball({0.3, -0.2, -0.8}, 0.35, 8, 0, true), reference::glass(1.4f));
  Material veil = diffuse({0.2f, 0.9f, 0.3f});
  veil.kind = Material::Kind::kTransparent;
  veil.opacity = 0.4f;
  add_mesh(scene, rectangle({-0.6, 0, -0.9}, {0.2, 0, 0.1}, {0, 0.6, 0}, 0), veil);
  scene.trace.traversal = Traversal::kBvh;
  check_picture(context, scene, kCamera, "cones", kTolerance, 0.2);
  const Image cones = render_on_device(context, scene, kCamera);
  scene.trace.traversal = Traversal::kAuto;
  const Image packets = render_on_device(context, scene, kCamera);
  scene.trace.view_footprint = 0.0f;
  const Image bare = render_on_device(context, scene, kCamera);
  double apart = 0, by_footprint = 0;
  for (std::size_t i = 0; i < cones.data.size(); ++i) {
    apart += std::abs(static_cast<double>(cones.data[i]) - packets.data[i]);
    by_footprint += std::abs(static_cast<double>(cones.data[i]) - bare.data[i]);
  }
  CHECK(by_footprint > 0.004 * static_cast<double>(cones.data.size()));
  CHECK(apart < 0.02 * by_footprint);
}

TEST_CASE("samples of a pixel share its footprint, in packets and ray by ray") {
  Context context = make_test_context();
  Scene scene = cloud_scene(1);
  for (float& scale : scene.gaussians.log_scales) scale -= 1.5f;
  add_mesh(scene, ball({0.2, 0.1, 0}, 0.6, 8, 0, true), white(Material::Kind::kMirror));
  for (const CameraModel lens : {CameraModel::kPinhole, CameraModel::kOrthographic}) {
    for (const Traversal traversal : {Traversal::kAuto, Traversal::kBvh}) {
      CAPTURE(static_cast<int>(lens));
      CAPTURE(static_cast<int>(traversal));
      Camera camera = cube_camera(30, 26);
      camera.model = lens;
      if (lens == CameraModel::kOrthographic) camera.fx = camera.fy = 9;
      scene.trace.traversal = traversal;
      const auto tracer_of = [&](float footprint, int samples) {
        scene.trace.view_footprint = footprint;
        scene.render.samples = samples;
        return PathTracer(context, scene);
      };
      PathTracer tracer = tracer_of(0.8f, 4);
      const Image four = tracer.render(camera);
      PathTracer halved = tracer_of(0.4f, 1), bare = tracer_of(0.0f, 1);
      std::vector<double> mean(four.data.size()), mean_bare(four.data.size());
      for (std::size_t k = 0; k < 4; ++k) {
        const Camera view = moved_in_pixels(camera, pixel_place(k, 4, scene.render.seed));
        const Image one = halved.render(view), other = bare.render(view);
        for (std::size_t i = 0; i < mean.size(); ++i) {
          mean[i] += 0.25 * one.data[i];
          mean_bare[i] += 0.25 * other.data[i];
        }
      }
      double apart = 0, from_bare = 0;
      for (std::size_t i = 0; i < mean.size(); ++i) {
        apart = std::max(apart, std::abs(mean[i] - four.data[i]));
        from_bare = std::max(from_bare, std::abs(mean_bare[i] - four.data[i]));
      }
      CHECK(apart < 1e-5);
      CHECK(from_bare > 1e-2);
      tracer.set_sampling(1, scene.render.seed);
      CHECK(tracer.render(camera).data == tracer_of(0.8f, 1).render(camera).data);
    }
  }
}
