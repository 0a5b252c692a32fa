// SPDX-License-Identifier: Apache-2.0
// Bodies that light goes on from: mirrors, glass and veils, against the reference.
#include "unit/light/light_fixture.hpp"

using namespace raysplats;
using reference::ball;
using reference::box;
using reference::cube_camera;
using reference::glass;
using reference::rectangle;
using reference::white;

TEST_CASE("mirrors") {
  Context context = make_test_context();
  for (const HitOrder order : {HitOrder::kEntry, HitOrder::kPeak}) {
    Scene scene = cloud_scene(2);
    scene.trace.hit_order = order;
    scene.lights = {lamp()};
    Material tinted = white(Material::Kind::kMirror);
    tinted.color = {0.9f, 0.8f, 0.5f};
    add_mesh(scene, rectangle({0.2, 0, 0.8}, {1.2, 0, 0.6}, {0.1, 1.1, 0}, 0), tinted);
    check_picture(context, scene, kCamera, "plane");
    tinted.emission = {0.1f, 0, 0};
    add_mesh(scene, ball({-0.4, 0.3, -0.3}, 0.5, 8, 0, true), tinted);
    check_picture(context, scene, kCamera, "ball before the plane");
    scene.render.max_bounces = 1;
    check_picture(context, scene, kCamera, "one bounce: black mirrors");
    scene.render.max_bounces = 2;
    check_picture(context, scene, kCamera, "two bounces");
    scene.render.max_bounces = 8;
    scene.render.min_throughput = 0.7f;
    check_picture(context, scene, kCamera, "ended by throughput");
  }
}

TEST_CASE("glass") {
  Context context = make_test_context();
  Scene scene = cloud_scene();
  add_floor(scene);
  // Two surfaces split, the third shows what it is: nothing is left to chance.
  scene.render.max_bounces = 3;
  Material tinted = glass(1.5f);
  tinted.color = {0.9f, 1.0f, 0.8f};
  tinted.absorption = {0.2f, 0.05f, 0.6f};
  add_mesh(scene, box({-0.7, -0.6, -0.5}, {0.4, 0.6, 0.5}, 0), tinted);
  check_picture(context, scene, kCamera, "box");
  scene.lights = {lamp()};
  check_picture(context, scene, kCamera, "box with shadows");
  scene.trace.hit_order = HitOrder::kPeak;
  scene.meshes[1] = ball({0, 0, 0}, 0.8, 10, 1, true);
  check_picture(context, scene, kCamera, "ball in peak order");
  scene.trace.hit_order = HitOrder::kEntry;
  scene.lights.clear();
  check_picture(context, scene, kCamera, "ball");
  scene.gaussians = Gaussians{};
  check_picture(context, scene, kCamera, "ball alone");
  // So coarse that many directions about the shading normal end on the wrong side.
  scene.environment.equirect = waves(32, 16);
  scene.meshes[1] = ball({0, 0, 0}, 0.8, 3, 1, true);
  check_picture(context, scene, cube_camera(32, 32), "coarse smooth ball", kLitByPicture);
  scene.environment.equirect = Image{};
  // More surfaces: the rays that leave the box stay few, and few pixels have a chance left.
  scene.meshes[1] = box({-0.7, -0.6, -0.5}, {0.4, 0.6, 0.5}, 1);
  scene.render.max_bounces = 2;
  check_picture(context, scene, kCamera, "two bounces");
}

TEST_CASE("nested and overlapping bodies of glass") {
  Context context = make_test_context();
  Scene scene;
  scene.environment.equirect = waves(32, 16);
  scene.environment.color = {1, 1, 1};
  scene.environment.up = {0, -1, 0};
  scene.render.max_bounces = 8;
  // The indices are close, so that one way through carries nearly all and the rest ends early.
  scene.render.min_throughput = 0.05f;
  Material outer = glass(1.20f), inner = glass(1.25f);
  outer.absorption = {0.1f, 0.3f, 0.0f};
  inner.absorption = {0.4f, 0.0f, 0.2f};
  const auto check = [&](const char* what) {
    check_picture(context, scene, kCamera, what, kTolerance, 0.15);
  };
  // Surfaces behind the second choose by chance; where they reflect less than the tolerance a
  // picture of all pixels still tells whether indices and absorption are right.
  add_mesh(scene, box({-0.9, -0.9, -0.9}, {0.9, 0.9, 0.9}, 0), outer);
  add_mesh(scene, box({-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5}, 0), inner);
  scene.render.max_bounces = 3;
  check("nested, up to the inner body's back");
  scene.render.max_bounces = 8;
  // From within: the camera stands in no body's stack, the first surface it meets is left.
  scene.meshes[0] = box({-9, -9, -9}, {9, 9, 0.8}, 0);
  scene.meshes[1] = box({-0.5, -0.5, 0.0}, {0.5, 0.5, 2}, 1);
  scene.render.max_bounces = 3;
  check("camera in a body, overlapping another");
  // Equal indices let rays pass straight on without a choice.
  scene.materials[1].ior = scene.materials[0].ior;
  scene.meshes[0] = box({-0.9, -0.9, -0.9}, {0.9, 0.9, 0.9}, 0);
  scene.meshes[1] = box({-0.5, -0.5, -0.5}, {0.5, 0.5, 0.5}, 1);
  scene.render.max_bounces = 5;
  check("an inner body of the same index");
  scene.materials[0].ior = scene.materials[1].ior = 1.0f;
  scene.render.max_bounces = 8;
  check_picture(context, scene, kCamera, "absorption alone", 1e-4, 0.05);
}

TEST_CASE("transparent surfaces") {
  Context context = make_test_context();
  Scene scene = cloud_scene(1);
  Material veil = diffuse({0.9f, 0.5f, 0.2f});
  veil.kind = Material::Kind::kTransparent;
  veil.opacity = 0.35f;
  veil.specular = 0.5f;
  veil.roughness = 0.5f;
  scene.lights = {lamp()};
  scene.render.shadows.mesh_on_gaussians = false;
  add_mesh(scene, rectangle({0, 0, -0.7}, {0.9, 0.1, 0}, {0, 0.8, 0.2}, 0), veil);
  veil.opacity = 0.8f;
  add_mesh(scene, ball({0.3, 0.2, 0.3}, 0.6, 7, 0, true), veil);
  check_picture(context, scene, kCamera, "veils", kTolerance, 0.06);
  scene.render.max_bounces = 2;
  check_picture(context, scene, kCamera, "two bounces", kTolerance, 0.06);
}

TEST_CASE("bodies that change nothing leave every pixel as it is, dark ones too") {
  Context context = make_test_context();
  Scene scene = cloud_scene(1);
  for (float& opacity : scene.gaussians.opacities) opacity = 4.0f;  // little light passes
  const Image without = render_on_device(context, scene, kCamera);
  scene.render.shadows.mesh_on_gaussians = false;
  Scene ball_of_air = scene;
  add_mesh(ball_of_air, ball({0, 0, 0}, 0.8, 8, 0, true), glass(1.0f));
  CHECK(largest_difference(render_on_device(context, ball_of_air, kCamera), without) < 1e-3);
  Scene veiled = scene;
  Material nothing = white(Material::Kind::kTransparent);
  nothing.opacity = 0.0f;
  add_mesh(veiled, rectangle({0, 0, 0}, {2, 0, 0}, {0, 2, 0.5}, 0), nothing);
  CHECK(largest_difference(render_on_device(context, veiled, kCamera), without) < 1e-3);
}

TEST_CASE("rays into the very seam of two mirrors are reflected by both") {
  Context context = make_test_context();
  for (const double size : {1.0, 1e-6, 1e4}) {
    CAPTURE(size);
    Scene scene;
    scene.environment.color = {1, 1, 1};
    scene.environment.up = {0, -1, 0};
    Material mirror = white(Material::Kind::kMirror);
    mirror.color = {0.5f, 0.5f, 0.5f};
    // The planes x = 0 and y = 0, which meet in the z axis, seen along x = y.
    add_mesh(scene, rectangle({0, 2 * size, 0}, {0, 2 * size, 0}, {0, 0, 2 * size}, 0), mirror);
    add_mesh(scene, rectangle({2 * size, 0, 0}, {2 * size, 0, 0}, {0, 0, 2 * size}, 0), mirror);
    const Camera camera = look_at({size, size, 0}, {0, 0, 0}, {0, 0, 1}, 101, 101, 101.0);
    const Image image = render_on_device(context, scene, camera);
    std::size_t once = 0;
    for (int y = 0; y < 101; ++y) {
      for (int x = 0; x < 101; ++x) once += image.at(x, y, 0) > 0.3f ? 1 : 0;
    }
    CHECK(once == 0);
    CHECK(image.at(50, 50, 0) == doctest::Approx(0.25));
  }
}
