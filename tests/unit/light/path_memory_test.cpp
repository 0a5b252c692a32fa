// SPDX-License-Identifier: Apache-2.0
#include "light/path_memory.hpp"

#include "raysplats/error.hpp"
#include "scene/image/pixel_count.hpp"
#include "unit/light/light_fixture.hpp"

using namespace raysplats;
using reference::ball;
using reference::cube_camera;
using reference::white;

namespace {

// Most bytes that the device held while a picture was drawn.
double bytes_held(const Scene& scene, const Camera& camera) {
  Context context = make_test_context();
  PathTracer(context, scene).render(camera);
  return static_cast<double>(context.peak_allocated_bytes());
}

double estimated(const Scene& scene, const Camera& camera) {
  const PathMemory memory(scene, make_test_context().device());
  return static_cast<double>(memory.total(pixel_count(camera)));
}

/// All rays one by one: what packets take at most is more than they mostly do.
void through_a_lens(Scene& scene) {
  scene.render.samples = 2;
  scene.render.aperture = 1e-3f;
}

Scene many_gaussians(std::size_t count, int sh_degree) {
  Scene scene = cloud_scene();
  scene.gaussians = reference::random_scene(count, 31, sh_degree);
  through_a_lens(scene);
  return scene;
}

void check_within(const Scene& scene, int width, double share) {
  const Camera camera = cube_camera(width, width);
  REQUIRE(scene.render.aperture > 0.0f);
  CHECK(estimated(scene, camera) == doctest::Approx(bytes_held(scene, camera)).epsilon(share));
}

}  // namespace

TEST_CASE("what a scene takes on the device is estimated to three percent") {
  check_within(many_gaussians(60000, 0), 64, 0.03);
  check_within(many_gaussians(20000, 3), 64, 0.03);
  Scene scene = many_gaussians(30000, 1);
  scene.trace.adaptive_radius = true;
  check_within(scene, 64, 0.03);
  scene = cloud_scene();
  through_a_lens(scene);
  check_within(scene, 300, 0.03);
  // Triangles, with a lamp on them and with a picture around.
  add_mesh(scene, ball({0.2, 0.1, 0}, 0.7, 120, 0, true), Material{});
  check_within(scene, 64, 0.03);
  scene.lights = {lamp()};
  check_within(scene, 200, 0.03);
  scene.environment.equirect = Image(512, 256, 3);
  scene.textures.emplace_back(300, 300, 3);
  check_within(scene, 100, 0.03);
}

TEST_CASE("paths through glass take no more than is estimated") {
  Scene scene = cloud_scene();
  Material glass = white(Material::Kind::kGlass);
  glass.ior = 1.5f;
  add_mesh(scene, ball({0.2, 0.1, 0}, 1.3, 12, 0, true), glass);
  through_a_lens(scene);
  const Camera camera = cube_camera(120, 120);
  const double held = bytes_held(scene, camera);
  CHECK(held <= estimated(scene, camera));
  CHECK(held > 0.3 * estimated(scene, camera));
}

TEST_CASE("packets of camera rays take no more than is estimated") {
  Scene scene = many_gaussians(20000, 0);
  scene.render.samples = 1;
  scene.trace.memory_budget = std::size_t{64} << 20;
  const Camera camera = cube_camera(200, 200);
  const double held = bytes_held(scene, camera);
  CHECK(held <= estimated(scene, camera));
  CHECK(held > 0.5 * estimated(scene, camera));
}

TEST_CASE("a batch of paths fits its share of the budget, a scene that does not fit is refused") {
  DeviceInfo device;
  device.name = "a device";
  device.type = DeviceType::kGpu;
  device.global_memory = std::uint64_t{1} << 30;
  device.max_allocation = std::uint64_t{1} << 28;
  Scene scene = cloud_scene();
  scene.trace.memory_budget = std::size_t{64} << 20;
  scene.render.samples = 2;
  const std::size_t many = 100'000'000;
  {
    const PathMemory memory(scene, device);
    CHECK(memory.paths(many) <= std::size_t{32} << 20);
    CHECK(memory.paths(many) > std::size_t{31} << 20);
    CHECK_NOTHROW(memory.check(many));
  }
  scene.trace.memory_budget = std::size_t{4} << 30;
  PathMemory memory(scene, device);
  CHECK_NOTHROW(memory.check(1000));
  memory.set_meshes(100'000'000);
  CHECK_THROWS_WITH_AS(memory.check(1000), doctest::Contains("for meshes"), ResourceError);
  memory.set_meshes(0);
  // More in one buffer than the device gives, though it has room.
  device.max_allocation = 1 << 10;
  const PathMemory narrow(scene, device);
  CHECK_THROWS_WITH_AS(narrow.check(1000), doctest::Contains("in the largest buffer"),
                       ResourceError);
}

TEST_CASE(
    "rays of a sample leave one point unless the lens is open and more samples go through it") {
  const Scene scene = many_gaussians(1000, 0);
  PathMemory memory(scene, make_test_context().device());
  constexpr std::size_t kPixels = 10'000;
  CHECK(!memory.packets(kPixels));
  RenderSettings one = scene.render;
  one.samples = 1;
  memory.set_render(one);
  CHECK(memory.packets(kPixels));
  memory.set_render(one, true);
  CHECK(!memory.packets(kPixels));
  one.aperture = 0.0f;
  memory.set_render(one, true);
  CHECK(memory.packets(kPixels));
}
