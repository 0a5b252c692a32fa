// SPDX-License-Identifier: Apache-2.0
// Shadows that few flat triangles throw on themselves where their normals are those of something
// round.
#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <numbers>

#include "light/surface_store.hpp"
#include "trace/camera_rays.hpp"
#include "unit/light/light_fixture.hpp"

using namespace raysplats;
using reference::ball;
using reference::cube_camera;
using reference::rectangle;

namespace {

// About the ball, which the camera sees from z = -4: so that the terminator goes through the
// picture.
constexpr std::array<std::array<float, 3>, 4> kGrazing{
    {{10, 1, -0.5}, {-9, 3, -2}, {1, -10, -1}, {-3, 8, 2}}};

/// A ball of 8 x 4 facets and nothing else, with black shadows.
Scene coarse_ball(bool smooth) {
  Scene scene;
  scene.render.ambient = {0, 0, 0};
  scene.render.shadows.strength = 1.0f;
  add_mesh(scene, ball({0, 0, 0}, 1, 4, 0, smooth), diffuse({1, 1, 1}));
  return scene;
}

/// The box with the normals that averaging over its faces gives.
Mesh smooth_box(const glm::dvec3& low, const glm::dvec3& high) {
  Mesh mesh = reference::box(low, high, 0);
  for (std::size_t i = 0; i < mesh.positions.size(); ++i) {
    const auto axis = static_cast<int>(i % 3);
    const double middle = (low[axis] + high[axis]) / 2;
    mesh.normals.push_back(mesh.positions[i] < middle ? -0.57735027f : 0.57735027f);
  }
  return mesh;
}

/// From ten or so away, so that a white ball shows about the cosine of its normals with the light.
Light distant_light(const std::array<float, 3>& position) {
  Light light;
  light.position = position;
  light.color = {100, 100, 100};
  return light;
}

Image picture(Context& context, Scene scene, const Camera& camera, bool shadows) {
  scene.render.shadows.mesh_on_mesh = shadows;
  return render_on_device(context, scene, camera);
}

/// Pixels that show light, and those of them that shadows change.
struct Shaded {
  std::size_t lit = 0;
  std::size_t dark = 0;
};

Shaded shaded(Context& context, const Scene& scene, const Camera& camera) {
  const Image without = picture(context, scene, camera, false);
  const Image with = picture(context, scene, camera, true);
  Shaded out;
  for (std::size_t i = 0; i < without.pixels(); ++i) {
    if (without.data[4 * i] < 0.02f) continue;
    ++out.lit;
    out.dark += with.data[4 * i] != without.data[4 * i] ? 1 : 0;
  }
  return out;
}

}  // namespace

TEST_CASE("a coarse ball is dark nowhere that its normals see the light [small]") {
  Context context = make_test_context();
  for (const bool smooth : {true, false}) {
    CAPTURE(smooth);
    Scene scene = coarse_ball(smooth);
    for (const std::array<float, 3>& position : kGrazing) {
      CAPTURE(position[0]);
      scene.lights = {distant_light(position)};
      const Shaded pixels = shaded(context, scene, cube_camera(40, 40));
      CHECK(pixels.lit > 150);
      CHECK(pixels.dark == 0);
    }
  }
}

TEST_CASE("a coarse smooth ball has the shadows of others, as in double precision") {
  Context context = make_test_context();
  const Camera camera = cube_camera(32, 32);
  Scene scene = coarse_ball(true);
  add_mesh(scene, rectangle({1.6, 0.1, -0.5}, {0, 0.4, 0}, {0, 0, 0.4}, 0), diffuse({0, 0, 0}));
  scene.lights = {distant_light({10, -1, -0.5})};
  CHECK(shaded(context, scene, camera).dark > 20);
  add_floor(scene);  // shows the ball's own shadow
  check_picture(context, scene, camera, "a shade beside it");
  for (float& x : scene.meshes[0].normals) x = -x;
  check_picture(context, scene, camera, "normals on the other side");
  // From within, where no facet lies behind the planes of its corners.
  scene = coarse_ball(true);
  scene.lights = {distant_light({0.3f, -0.2f, 0.1f})};
  scene.lights[0].color = {0.2f, 0.2f, 0.2f};
  check_picture(context, scene, look_at({0.1, 0, -0.4}, {0, 0.2, 0.5}, {0, -1, 0}, 32, 32, 20.0),
                "from within");
}

TEST_CASE("a smooth column of few sides is lit at its very edges [small]") {
  // The camera's middle column looks at an edge, where triangles meet and their planes part.
  Mesh column;
  constexpr std::uint32_t kSides = 6;
  for (std::uint32_t side = 0; side < kSides; ++side) {
    const double angle = 2.0 * std::numbers::pi * side / kSides;
    const auto x = static_cast<float>(std::sin(angle)), z = static_cast<float>(-std::cos(angle));
    column.positions.insert(column.positions.end(), {x, -1, z, x, 1, z});
    column.normals.insert(column.normals.end(), {x, 0, z, x, 0, z});
    const std::uint32_t a = 2 * side, c = 2 * ((side + 1) % kSides);
    column.triangles.insert(column.triangles.end(), {a, c, a + 1, c, c + 1, a + 1});
    column.materials.insert(column.materials.end(), {0, 0});
  }
  Context context = make_test_context();
  Scene scene = coarse_ball(true);
  scene.meshes = {column};
  scene.lights = {distant_light({10, 0.3f, -1.5f})};
  const Shaded pixels = shaded(context, scene, cube_camera(41, 41));
  CHECK(pixels.lit > 400);
  CHECK(pixels.dark == 0);
}

TEST_CASE("a box whose normals are averaged has the shadows of what stands on it") {
  // Seen from above, so that its upper face fills the picture.
  Context context = make_test_context();
  const Camera camera = look_at({0.03, -4, 0.02}, {0, 0, 0}, {0, 0, 1}, 40, 40, 80.0);
  Scene scene = coarse_ball(true);
  const glm::dvec3 low(-1.5, 0.4, -1.5), high(1.5, 0.6, 1.5);
  scene.meshes = {reference::box(low, high, 0),
                  reference::box({-0.3, -0.2, -0.3}, {0.3, 0.4, 0.3}, 0)};
  Light sun;
  sun.kind = Light::Kind::kDirectional;
  sun.direction = {0.5f, 1.0f, 0.3f};
  scene.lights = {sun};
  const Shaded flat = shaded(context, scene, camera);
  CHECK(flat.dark > 40);
  scene.meshes[0] = smooth_box(low, high);
  CHECK(shaded(context, scene, camera).dark == flat.dark);
  check_picture(context, scene, camera, "a cube on a smooth box");
}

TEST_CASE("rays to lights leave flat triangles where they did, to the bit [small]") {
  Context context = make_test_context();
  const Camera camera = cube_camera(40, 40);
  constexpr std::size_t kRays = 40 * 40;
  const auto count = static_cast<std::uint32_t>(kRays);
  for (const bool smooth : {false, true}) {
    const Scene scene = coarse_ball(smooth);
    SurfaceStore surfaces(context, scene);
    Buffer<Ray> rays;
    CameraRays(context).generate(camera, Lens(), 0, kRays, rays);
    Buffer<RsPath> paths(context, kRays, "paths");
    Buffer<RsSurfaceHit> hits(context, kRays, "surface hits");
    Buffer<std::uint32_t> from_origin(context, kRays, "colour directions");
    Buffer<RsSurface> met(context, kRays, "surfaces");
    const auto kernel = [&](const char* name) {
      return context.kernel("light/path_tracer.cl", name);
    };
    const Range each = Range::linear(kRays, 64);
    Buffer<RsCone> cones(context, kRays, "cones of rays");
    cones.clear();
    kernel("begin_paths").launch(each, count, 1, rays, cones, paths);
    surfaces.triangles().nearest(rays, kRays, hits);
    kernel("load_surfaces")
        .launch(each, count, hits, surfaces.vertices(), surfaces.triangle_materials(),
                surfaces.materials(), surfaces.textures(), surfaces.texels(), paths, rays,
                from_origin, cones, met);
    std::size_t surfaces_met = 0, moved = 0;
    for (const RsSurface& s : met.download()) {
      if (s.material < 0) continue;
      ++surfaces_met;
      moved += std::memcmp(s.shadow_origin, s.position, sizeof s.position) != 0 ? 1 : 0;
    }
    CHECK(surfaces_met > kRays / 4);
    CHECK((smooth ? moved == surfaces_met : moved == 0));
  }
}
