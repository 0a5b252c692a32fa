// SPDX-License-Identifier: Apache-2.0
#include "io/scene/scene_file.hpp"

#include <doctest/doctest.h>

#include <array>
#include <string>
#include <utility>
#include <vector>

#include "unit/io/scene_folder.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

glm::dvec3 apply(const glm::dmat4& m, const glm::dvec3& v) {
  return glm::dvec3(m * glm::dvec4(v, 1.0));
}

}  // namespace

TEST_CASE("scene file: models and meshes with every kind of transform") {
  const SceneFolder folder;
  const SceneFile scene = folder.read(R"(
[[model]]
file = "model.ply"
translate = [1, 2, 3]
rotate = { axis = [0, 0, 2], degrees = 90 }
scale = 2

[[model]]
file = "model.ply"
rotate = [90, 0, 90]

[[mesh]]
file = "cube.obj"
matrix = [1, 0, 0, 5,  0, 2, 0, 6,  0, 0, 3, 7,  0, 0, 0, 1]
normals = "smooth"
crease_angle = 30.5

[[mesh]]
file = "cube.obj"
scale = [1, 2, -3]
normals = "flat"
material = "steel"
move = [10, 0, 0]
turn = { axis = [0, 1, 0], degrees = 180, pivot = [0, 0, 1] }

[[mesh]]
file = "cube.obj"
translate = [0, 3, 0]
turn = { axis = [1, 0, 0], degrees = 90 }
material = { Body = "steel" }

[[material]]
name = "steel"
kind = "mirror"
)");
  REQUIRE(scene.models.size() == 2);
  CHECK(scene.models[0].file == folder.scratch() / "model.ply");
  CHECK(near(apply(scene.models[0].transform, {1, 0, 0}), {1, 4, 3}));
  // About x first, then about z.
  CHECK(near(apply(scene.models[1].transform, {0, 1, 0}), {0, 0, 1}));
  CHECK(near(apply(scene.models[1].transform, {1, 0, 0}), {0, 1, 0}));
  CHECK(near(apply(scene.models[1].transform, {0, 0, 1}), {1, 0, 0}));

  REQUIRE(scene.meshes.size() == 3);
  const SceneMesh& first = scene.meshes[0];
  CHECK(near(apply(first.transform, {1, 1, 1}), {6, 8, 10}));
  CHECK(first.normals == SceneMesh::Normals::kSmooth);
  CHECK(first.crease_angle == 30.5);
  CHECK_FALSE(first.moves());
  CHECK(first.placement(0.7) == first.transform);
  const SceneMesh& second = scene.meshes[1];
  CHECK(second.normals == SceneMesh::Normals::kFlat);
  CHECK(second.material == "steel");
  CHECK(second.moves());
  CHECK(near(apply(second.placement(0.0), {1, 1, 1}), {1, 2, -3}));
  // Half of 180 degrees about the y axis through (0, 0, 1), then half of the way.
  CHECK(near(apply(second.placement(0.5), {0, 0, 0}), {4, 0, 1}));
  CHECK(near(apply(second.placement(1.0), {0, 0, 0}), {10, 0, 2}));
  // Without a pivot the turn is about the mesh's own origin.
  const SceneMesh& third = scene.meshes[2];
  CHECK(near(apply(third.placement(1.0), {0, 0, 0}), {0, 3, 0}));
  CHECK(near(apply(third.placement(1.0), {0, 1, 0}), {0, 3, 1}));
  CHECK(third.materials == std::vector<std::pair<std::string, std::string>>{{"Body", "steel"}});
}

TEST_CASE("scene file: every key of materials and lights") {
  const SceneFolder folder;
  const SceneFile scene = folder.read(kMesh + R"(
[[material]]
name = "wood"
kind = "diffuse"
color = [0.5, 0.25, 1]
texture = "wood.png"
specular = 0.3
roughness = 0.4
emission = [0, 1, 2]
shadow = 0.5

[[material]]
name = "window"
kind = "glass"
ior = 1.33
absorption = [1, 2, 3]

[[material]]
name = "veil"
kind = "transparent"
opacity = 0.3

[[material]]
name = "lamp"
kind = "emissive"
emission = [5, 4, 3]

[[light]]
kind = "point"
position = [1, 2, 3]
color = [1, 0.5, 0.25]
intensity = 4

[[light]]
kind = "directional"
direction = [0, -2, 0]

[[light]]
kind = "sphere"
position = [4, 5, 6]
radius = 0.5
)");
  REQUIRE(scene.materials.size() == 4);
  const Material& wood = scene.materials[0].material;
  CHECK(wood.name == "wood");
  CHECK(wood.kind == Material::Kind::kDiffuse);
  CHECK(wood.color == Rgb{0.5f, 0.25f, 1.0f});
  CHECK(scene.materials[0].texture == folder.scratch() / "wood.png");
  CHECK(wood.specular == 0.3f);
  CHECK(wood.roughness == 0.4f);
  CHECK(wood.emission == Rgb{0, 1, 2});
  CHECK(wood.shadow == 0.5f);
  const Material& glass = scene.materials[1].material;
  CHECK(glass.kind == Material::Kind::kGlass);
  CHECK(glass.ior == 1.33f);
  CHECK(glass.absorption == Rgb{1, 2, 3});
  CHECK(glass.color == Rgb{1, 1, 1});
  CHECK_FALSE(glass.shadow.has_value());
  CHECK(scene.materials[2].material.kind == Material::Kind::kTransparent);
  CHECK(scene.materials[2].material.opacity == 0.3f);
  CHECK(scene.materials[3].material.kind == Material::Kind::kEmissive);
  CHECK(scene.materials[3].material.emission == Rgb{5, 4, 3});

  REQUIRE(scene.lights.size() == 3);
  CHECK(scene.lights[0].kind == Light::Kind::kPoint);
  CHECK(scene.lights[0].position == std::array<float, 3>{1, 2, 3});
  CHECK(scene.lights[0].color == Rgb{4, 2, 1});
  CHECK(scene.lights[1].kind == Light::Kind::kDirectional);
  CHECK(scene.lights[1].direction == std::array<float, 3>{0, -1, 0});
  CHECK(scene.lights[1].color == Rgb{1, 1, 1});
  CHECK(scene.lights[2].kind == Light::Kind::kSphere);
  CHECK(scene.lights[2].position == std::array<float, 3>{4, 5, 6});
  CHECK(scene.lights[2].radius == 0.5f);
}

TEST_CASE("scene file: every key of environment, render, trace and animation") {
  const SceneFolder folder;
  const SceneFile scene = folder.read(kModel + R"(
[environment]
color = [1, 2, 3]
image = "sky.exr"
exposure = -1.5
up = [0, 0, 1]
rotation = 30

[render]
samples = 16
max-bounces = 3
min-throughput = 0.01
seed = 7
ambient = [0.1, 0.2, 0.3]
indirect = true
light-samples = 8
aperture = 0.25
focus-distance = 2.5
bias = 0.125
[render.shadows]
mesh-on-mesh = false
mesh-on-gaussians = false
gaussians-on-mesh = false
gaussians-on-gaussians = true
strength = 0.5

[trace]
quantile = 9
min-transmittance = 0.001
max-hits = 100
hit-order = "peak"
adaptive-radius = true
view-footprint = 0.25
background = [1, 1, 0.5]
packet-width = 8
memory-budget = 64

[animation]
frames = 24
)");
  CHECK(scene.environment.color == Rgb{1, 2, 3});
  CHECK(scene.environment.image == folder.scratch() / "sky.exr");
  CHECK(scene.environment.exposure == -1.5f);
  CHECK(scene.environment.up == glm::dvec3(0, 0, 1));
  CHECK(scene.environment.rotation == 30.0f);
  const RenderSettings& render = scene.render;
  CHECK(render.samples == 16);
  CHECK(render.max_bounces == 3);
  CHECK(render.min_throughput == 0.01f);
  CHECK(render.seed == 7);
  CHECK(render.ambient == Rgb{0.1f, 0.2f, 0.3f});
  CHECK(render.indirect);
  CHECK(render.light_samples == 8);
  CHECK(render.aperture == 0.25f);
  CHECK(render.focus_distance == 2.5f);
  CHECK(render.bias == 0.125f);
  CHECK_FALSE(render.shadows.mesh_on_mesh);
  CHECK_FALSE(render.shadows.mesh_on_gaussians);
  CHECK_FALSE(render.shadows.gaussians_on_mesh);
  CHECK(render.shadows.gaussians_on_gaussians);
  CHECK(render.shadows.strength == 0.5f);
  const TraceOptions trace = scene.trace.over({});
  CHECK(trace.quantile == 9.0f);
  CHECK(trace.min_transmittance == 0.001f);
  CHECK(trace.max_hits == 100);
  CHECK(trace.hit_order == HitOrder::kPeak);
  CHECK(trace.adaptive_radius);
  CHECK(trace.view_footprint == 0.25f);
  CHECK(trace.background == std::array<float, 3>{1, 1, 0.5f});
  CHECK(trace.packet_width == 8);
  CHECK(trace.memory_budget == std::size_t{64} << 20);
  CHECK(scene.frames == 24);

  // What is not given stays as the models were trained.
  TraceOptions trained;
  trained.hit_order = HitOrder::kPeak;
  trained.max_hits = 33;
  trained.view_footprint = 0.4f;
  const SceneFile plain = folder.read(kModel + "[trace]\nquantile = 8\n");
  CHECK(plain.trace.over(trained).max_hits == 33);
  CHECK(plain.trace.over(trained).view_footprint == 0.4f);
  CHECK(plain.trace.over(trained).hit_order == HitOrder::kPeak);
  CHECK(plain.trace.over(trained).quantile == 8.0f);
  CHECK_FALSE(plain.frames.has_value());
  CHECK(plain.render.samples == RenderSettings{}.samples);
  CHECK(plain.camera.source == SceneCamera::Source::kNone);
}
