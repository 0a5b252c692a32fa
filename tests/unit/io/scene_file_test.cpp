// SPDX-License-Identifier: Apache-2.0
#include "io/scene_file.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <string>
#include <utility>
#include <vector>

#include "raysplats/io.hpp"
#include "scene/camera_model.hpp"
#include "unit/io/data_sets.hpp"
#include "unit/io/scratch.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

/// A folder with the files that scenes name; their content matters to the loader alone.
class SceneFolder {
 public:
  SceneFolder() {
    for (const char* name : {"model.ply", "cube.obj", "wood.png", "sky.exr"}) {
      write_bytes(scratch_ / name, "x");
    }
  }
  SceneFile read(const std::string& text) const {
    write_bytes(path(), text);
    return read_scene_file(path());
  }
  /// The message of the error, which has to be of type E.
  template <class E>
  std::string refused(const std::string& text) const {
    try {
      read(text);
    } catch (const E& error) {
      return error.what();
    }
    return "";
  }
  fs::path path() const { return scratch_ / "scene.toml"; }
  const Scratch& scratch() const { return scratch_; }

 private:
  Scratch scratch_;
};

const std::string kModel = "[[model]]\nfile = 'model.ply'\n";
const std::string kMesh = "[[mesh]]\nfile = 'cube.obj'\n";

glm::dvec3 apply(const glm::dmat4& m, const glm::dvec3& v) {
  return glm::dvec3(m * glm::dvec4(v, 1.0));
}

bool near(const glm::dvec3& a, const glm::dvec3& b) { return glm::length(a - b) < 1e-9; }

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
  CHECK(trace.background == std::array<float, 3>{1, 1, 0.5f});
  CHECK(trace.packet_width == 8);
  CHECK(trace.memory_budget == std::size_t{64} << 20);
  CHECK(scene.frames == 24);

  // What is not given stays as the models were trained.
  TraceOptions trained;
  trained.hit_order = HitOrder::kPeak;
  trained.max_hits = 33;
  const SceneFile plain = folder.read(kModel + "[trace]\nquantile = 8\n");
  CHECK(plain.trace.over(trained).max_hits == 33);
  CHECK(plain.trace.over(trained).hit_order == HitOrder::kPeak);
  CHECK(plain.trace.over(trained).quantile == 8.0f);
  CHECK_FALSE(plain.frames.has_value());
  CHECK(plain.render.samples == RenderSettings{}.samples);
  CHECK(plain.camera.source == SceneCamera::Source::kNone);
}

TEST_CASE("scene file: placed cameras of every model") {
  const SceneFolder folder;
  const SceneExtent extent{{1, 0, 0}, 2.0};
  const auto camera = [&](const std::string& keys) {
    const SceneFile scene = folder.read(kModel + "[camera]\n" + keys);
    const std::vector<Camera> all = scene_cameras(scene.camera, extent, 5, {});
    REQUIRE(all.size() == 1);
    return all[0];
  };
  const std::string pose = "position = [0, 0, -4]\ntarget = [0, 0, 1]\nup = [0, -1, 0]\n";
  /// Angle between the axis and the ray through the middle of the picture's lower side.
  const auto half_angle = [](const Camera& c) {
    const CameraRay axis = camera_ray(c, c.cx, c.cy);
    const CameraRay side = camera_ray(c, c.cx, c.height);
    REQUIRE(side.valid);
    return glm::degrees(std::acos(glm::dot(axis.direction, side.direction)));
  };

  const Camera pinhole = camera(pose + "fov = 60\nwidth = 400\nheight = 300\n");
  CHECK(pinhole.model == CameraModel::kPinhole);
  CHECK(pinhole.width == 400);
  CHECK(pinhole.height == 300);
  CHECK(near(pinhole.center(), {0, 0, -4}));
  CHECK(near(camera_ray(pinhole, 200, 150).direction, {0, 0, 1}));
  CHECK(half_angle(pinhole) == doctest::Approx(30.0));
  CHECK(camera(pose).width == 800);
  CHECK(half_angle(camera(pose)) == doctest::Approx(22.5));
  const Camera focal = camera(pose + "focal = 123\nprincipal-point = [10, 20]\n");
  CHECK(focal.fx == 123.0);
  CHECK(focal.fy == 123.0);
  CHECK(focal.cx == 10.0);
  CHECK(focal.cy == 20.0);

  const Camera opencv = camera(
      pose + "model = 'opencv'\nfov = 50\nk1 = -0.1\nk2 = 0.01\nk3 = 0.001\np1 = 0\np2 = 0.002\n");
  CHECK(opencv.model == CameraModel::kOpenCv);
  CHECK(opencv.distortion.k1 == -0.1);
  CHECK(opencv.distortion.k2 == 0.01);
  CHECK(opencv.distortion.k3 == 0.001);
  CHECK(opencv.distortion.p2 == 0.002);
  const Camera fisheye = camera(
      pose + "model = 'fisheye'\nfov = 190\nk1 = 0.01\nk2 = 0.002\nk3 = 0.001\nk4 = 0.0001\n");
  CHECK(fisheye.model == CameraModel::kFisheye);
  CHECK(fisheye.distortion.k4 == 0.0001);
  CHECK(half_angle(fisheye) == doctest::Approx(95.0));
  CHECK(half_angle(camera(pose + "model = 'opencv'\nfov = 50\nk1 = -0.1\n")) ==
        doctest::Approx(25.0));
  const Camera round = camera(pose + "model = 'equirectangular'\nwidth = 200\n");
  CHECK(round.model == CameraModel::kEquirectangular);
  CHECK(round.height == 100);
  CHECK(near(camera_ray(round, 100, 50).direction, {0, 0, 1}));
  const Camera flat = camera(pose + "model = 'orthographic'\nextent = 4\nheight = 400\n");
  CHECK(flat.model == CameraModel::kOrthographic);
  CHECK(flat.fx == doctest::Approx(100.0));
  CHECK(glm::length(camera_ray(flat, 400, 0).origin - camera_ray(flat, 400, 400).origin) ==
        doctest::Approx(4.0));

  const SceneFile folding =
      folder.read(kModel + "[camera]\n" + pose + "model = 'opencv'\nk1 = -1\nfov = 120\n");
  CHECK_THROWS_AS(scene_cameras(folding.camera, extent, 1, {}), UsageError);
  const SceneFile none = folder.read(kModel);
  CHECK_THROWS_AS(scene_cameras(none.camera, extent, 1, {}), UsageError);
}

TEST_CASE("scene file: cameras of files, data sets and orbits") {
  const SceneFolder folder;
  const SceneExtent extent{{1, 0, 0}, 2.0};
  Camera base;
  base.width = 40;
  base.height = 20;
  base.fx = base.fy = 30;
  base.cx = 20;
  base.cy = 10;
  std::vector<Camera> written(4, base);
  for (std::size_t i = 0; i < written.size(); ++i) {
    written[i].name = "view_" + std::to_string(i);
    written[i].translation.z = 3.0 + static_cast<double>(i);
  }
  write_cameras(folder.scratch() / "transforms.json", written);

  const SceneFile file =
      folder.read(kModel + "[camera]\nfile = 'transforms.json'\ndownscale = 2\nviews = [3, 1]\n");
  const std::vector<Camera> chosen = scene_cameras(file.camera, extent, 1, {});
  REQUIRE(chosen.size() == 2);
  CHECK(chosen[0].name == "view_3");
  CHECK(chosen[1].name == "view_1");
  CHECK(chosen[0].width == 20);
  CHECK(chosen[0].fx == doctest::Approx(15.0));
  const SceneFile beyond =
      folder.read(kModel + "[camera]\nfile = 'transforms.json'\nviews = [4]\n");
  CHECK_THROWS_AS(scene_cameras(beyond.camera, extent, 1, {}), UsageError);

  const SceneFile orbit = folder.read(kModel + R"([camera]
width = 60
height = 40
fov = 50
up = [0, 0, 1]
orbit = { frames = 7, elevation = 10, distance = 5, target = [1, 2, 3] }
)");
  const std::vector<Camera> ring = scene_cameras(orbit.camera, extent, 3, {});
  REQUIRE(ring.size() == 7);
  for (const Camera& each : ring) {
    CHECK(each.width == 60);
    CHECK(glm::length(each.center() - glm::dvec3(1, 2, 3)) == doctest::Approx(5.0));
    CHECK(each.center().z == doctest::Approx(3 + 5 * std::sin(glm::radians(10.0))));
  }
  // Without a number the orbit takes as many frames as the animation, around what is there.
  const SceneFile free = folder.read(kModel + "[camera]\norbit = {}\nmodel = 'fisheye'\n");
  const std::vector<Camera> three = scene_cameras(free.camera, extent, 3, {});
  REQUIRE(three.size() == 3);
  CHECK(three[0].model == CameraModel::kFisheye);
  CHECK(near(three[0].center() + three[1].center() + three[2].center() -
                 3.0 * glm::dvec3(0, three[0].center().y, 0),
             {3, 0, 0}));
}

TEST_CASE("scene file: cameras count from the model's origin, data sets are as it was trained") {
  const SceneFolder folder;
  const SceneExtent extent;
  DatasetOptions trained;
  trained.downscale = 4;
  trained.test_every = 2;
  trained.origin = {4321012.125, -250000.5, 80.0};
  const glm::dvec3 origin(4321012.125, -250000.5, 80.0);

  Camera camera = look_at({0, 0, -6}, {0, 0, 0}, {0, -1, 0}, 40, 30, 30.0);
  camera.translation -= camera.rotation * origin;  // as a survey has it
  write_cameras(folder.scratch() / "transforms.json", std::vector{camera});
  const auto cameras = [&](const std::string& keys) {
    return scene_cameras(folder.read(kModel + "[camera]\n" + keys).camera, extent, 1, trained);
  };
  const auto check_file = [&](const std::vector<Camera>& all) {
    REQUIRE(all.size() == 1);
    CHECK(glm::length(all[0].center() - glm::dvec3(0, 0, -6)) < 1e-6);
    CHECK(all[0].width == 40);  // of photos alone is the size that of the training
  };
  check_file(cameras("file = 'transforms.json'\n"));
  SceneCamera given;
  given.source = SceneCamera::Source::kGiven;
  given.given = {camera};
  check_file(scene_cameras(given, extent, 1, trained));

  const ColmapFixture photos = small_colmap();
  photos.write_binary(folder.scratch() / "data/sparse/0");
  write_photos(photos, folder.scratch() / "data/images", 40, 30);
  DatasetOptions halved;
  halved.test_every = 2;
  const Dataset data = load_dataset(folder.scratch() / "data", halved);
  const View& first = data.views.at(data.indices(Split::kTest).at(0));
  const std::vector<Camera> test = cameras("data = 'data'\n");
  REQUIRE(test.size() == 5);
  CHECK(test[0].width == 10);
  CHECK(test[0].name == first.camera.name);
  CHECK(glm::length(test[0].center() - first.camera.center() + origin) < 1e-6);
  // What is given goes over it.
  const std::vector<Camera> more = cameras("data = 'data'\ndownscale = 2\ntest-every = 5\n");
  REQUIRE(more.size() == 2);
  CHECK(more[0].width == 20);
  const Camera on_orbit = cameras("data = 'data'\norbit = { frames = 1 }\n").at(0);
  CHECK(on_orbit.width == 10);
  CHECK(on_orbit.height == 8);
  // A panorama has its own shape.
  const std::string round = "data = 'data'\norbit = {}\nmodel = 'equirectangular'\n";
  CHECK(cameras(round).at(0).width == 10);
  CHECK(cameras(round).at(0).height == 5);
  CHECK(cameras(round + "width = 300\n").at(0).height == 150);
  CHECK(cameras(round + "height = 30\n").at(0).height == 30);
}

TEST_CASE("scene file: another size keeps what the smaller side sees") {
  Camera camera = look_at({0, 0, -3}, {0, 0, 0}, {0, -1, 0}, 800, 600, 500);
  const Camera half = resized(camera, 400, std::nullopt);
  CHECK(half.width == 400);
  CHECK(half.height == 300);
  CHECK(half.fx == 250.0);
  CHECK(half.cy == 150.0);
  const Camera square = resized(camera, 300, 300);
  CHECK(square.fx == 250.0);
  CHECK(square.fy == 250.0);
  CHECK(square.cx == 150.0);
  CHECK(resized(camera, std::nullopt, 1200).width == 1600);
  CHECK(resized(camera, std::nullopt, std::nullopt).fx == 500.0);
}

TEST_CASE("scene file: what is wrong is named with its line") {
  const SceneFolder folder;
  const auto usage = [&](const std::string& text, const std::vector<std::string>& parts) {
    const std::string message = folder.refused<UsageError>(text);
    INFO(text);
    INFO(message);
    CHECK(contains(message, "scene.toml"));
    for (const std::string& part : parts) CHECK(contains(message, part));
  };
  const std::string material = "[[material]]\nname = 'a'\nkind = 'mirror'\n";

  usage("", {"shows nothing"});
  usage("[camera]\nfile = \n", {"line 2"});
  usage(kModel + "[rendr]\n", {"line 3", "'rendr'", "'render'"});
  usage(kModel + "scael = 2\n", {"line 3", "'scael'", "[[model]]", "'scale'"});
  usage(kMesh + "turn = {axis = [0, 1, 0], degrees = 3, pivt = [0, 0, 0]}\n",
        {"line 3", "'pivt'", "'pivot'"});
  usage(kModel + "[render]\nmax-bounce = 3\n", {"line 4", "'max-bounces'"});
  usage(kModel + "[render]\nmax-bounces = 3\nmax_bounces = 3\n", {"twice"});
  usage(kModel + "[render.shadows]\nstrenght = 0\n", {"'strength'"});
  usage(kModel + "[animation]\nframe = 3\n", {"'frames'"});
  usage(kModel + "[trace]\nqq = 3\n", {"unknown key 'qq'"});
  usage(kModel + "[environment]\ncolour = [0, 0, 0]\n", {"'color'"});
  usage(kModel + "[[light]]\nkind = 'point'\nposition = [0, 0, 0]\nradius = 1\n", {"'radius'"});
  usage(material + "ior = 1.5\n" + kModel, {"line 4", "'ior' is for kind = \"glass\""});
  usage(kModel + "[camera]\nposition = [0, 0, 1]\ntarget = [0, 0, 0]\nk1 = 1\n", {"'k1'"});

  // Keys that exist, but not for the kind that is chosen.
  const std::string placed = kModel + "[camera]\nposition = [0, 0, 1]\ntarget = [0, 0, 0]\n";
  const std::string orbit = kModel + "[camera]\norbit = {}\n";
  usage(kMesh + "crease-angle = 30\n", {"line 3", "'crease-angle' is for normals = \"smooth\""});
  usage(kModel + "[[light]]\nkind = 'point'\nposition = [0, 0, 0]\nradius = 1\n",
        {"line 6", "'radius' is for kind = \"sphere\""});
  usage(kModel + "[[light]]\nkind = 'point'\nposition = [0, 0, 0]\ndirection = [0, 0, 1]\n",
        {"'direction' is for kind = \"directional\""});
  usage(kModel + "[[light]]\nkind = 'directional'\nposition = [0, 0, 0]\ndirection = [0, 0, 1]\n",
        {"'position' is for the kinds point and sphere"});
  usage(placed + "k1 = 1\n", {"line 6", "'k1' is for the models opencv and fisheye"});
  usage(placed + "model = 'fisheye'\np2 = 1\n", {"'p2' is for model = \"opencv\""});
  usage(placed + "model = 'opencv'\nk4 = 1\n", {"'k4' is for model = \"fisheye\""});
  usage(placed + "extent = 2\n", {"'extent' is for model = \"orthographic\""});
  for (const std::string key : {"fov", "focal"}) {
    for (const std::string model : {"equirectangular", "orthographic"}) {
      usage(placed + "model = '" + model + "'\n" + key + " = 50\n",
            {"'" + key + "' is for the models pinhole, opencv and fisheye"});
    }
  }
  usage(orbit + "model = 'equirectangular'\nprincipal-point = [1, 2]\n",
        {"'principal-point' is for every model but equirectangular"});
  usage(placed + "split = 'all'\n", {"'split' is for the views of 'data'"});
  usage(orbit + "undistort = false\n", {"'undistort' is for the views of 'data'"});
  usage(placed + "views = [1]\n", {"'views' is for 'file' and the views of 'data'"});
  usage(placed + "downscale = 2\n", {"'downscale' is for 'file' and 'data'"});
  usage(orbit + "target = [0, 0, 0]\n", {"'target' is for 'position'", "orbit.target"});
  for (const std::string key : {"width", "model", "fov", "k1"}) {
    usage(kModel + "[camera]\nfile = 'model.ply'\n" + key + " = 3\n",
          {"line 5", "'" + key + "' is for 'position' and 'orbit'"});
  }

  usage("model = 3\n", {"line 1", "[[model]]"});
  usage(kModel + "scale = 'big'\n", {"line 3", "'scale'", "list of 3 numbers", "a text"});
  usage(kModel + "translate = [1, 2]\n", {"3 numbers"});
  usage(kModel + "translate = [1, 2, 'x']\n", {"a text"});
  usage(kModel + "translate = [1, 2, inf]\n", {"finite"});
  usage(kModel + "rotate = {axis = [0, 0, 0], degrees = 3}\n", {"'axis'", "direction"});
  usage(kModel + "rotate = {degrees = 3}\n", {"'axis'"});
  usage(kModel + "scale = [1, 0, 1]\n", {"'scale'", "0"});
  usage(kModel + "matrix = [1, 2]\n", {"16 numbers"});
  usage(kModel + "matrix = [1,0,0,0, 0,1,0,0, 0,0,1,0, 1,0,0,1]\n", {"last row"});
  usage(kModel + "matrix = [1,0,0,0, 0,0,0,0, 0,0,1,0, 0,0,0,1]\n", {"invertible"});
  usage(kModel + "scale = 2\nmatrix = [1,0,0,0, 0,1,0,0, 0,0,1,0, 0,0,0,1]\n", {"stands alone"});
  usage("[[model]]\nscale = 1\n", {"line 1", "no 'file'"});
  usage("[[model]]\nfile = ''\n", {"empty"});
  usage("[[model]]\nfile = 3\n", {"text in quotes"});

  usage(kMesh + "material = 'steel'\n", {"line 1", "'steel'"});
  usage(kMesh + "material = 'b'\n" + material, {"line 1", "'b'", "'a'"});
  usage(kMesh + "material = {Body = 'b'}\n" + material, {"'b'", "'a'"});
  usage(kMesh + "material = {Body = 3}\n" + material, {"'Body'", "text"});
  usage(kMesh + "normals = 'round'\n", {"smooth", "'round'"});
  usage(kMesh + "normals = 'smooth'\ncrease-angle = 200\n", {"'crease-angle'", "180"});
  usage(kMesh + "turn = {axis = [0, 1, 0]}\n", {"'degrees'"});
  usage(kMesh + material + material, {"two [[material]]", "'a'"});
  usage(kMesh + "[[material]]\nkind = 'mirror'\n", {"no 'name'"});
  usage(kMesh + "[[material]]\nname = 'a'\n", {"no 'kind'"});
  usage(kMesh + "[[material]]\nname = 'a'\nkind = 'metal'\n", {"mirror or glass", "'metal'"});
  usage(kMesh + material + "color = [0, 2, 0]\n", {"'color'", "0 to 1"});
  usage(kMesh + material + "shadow = true\n", {"'shadow'", "a number", "true or false"});
  usage(kMesh + "[[light]]\nposition = [0, 0, 0]\n", {"no 'kind'"});
  usage(kMesh + "[[light]]\nkind = 'point'\n", {"no 'position'"});
  usage(kMesh + "[[light]]\nkind = 'directional'\n", {"no 'direction'"});

  usage(kModel + "[render]\nsamples = 1.5\n", {"whole number"});
  usage(kModel + "[render]\nsamples = 0\n", {"'samples'", "1 to"});
  usage(kModel + "[render]\nmax-bounces = 0\n", {"'max-bounces'", "1 to"});
  usage(kModel + "[render]\nlight-samples = 1025\n", {"'light-samples'", "1024"});
  usage(kModel + "[render]\nseed = -1\n", {"'seed'"});
  usage(kModel + "[render]\nindirect = 1\n", {"true or false"});
  usage(kModel + "[trace]\npacket-width = 3\n", {"'packet-width'"});
  usage(kModel + "[trace]\nhit-order = 'first'\n", {"entry or peak"});
  usage(kModel + "[animation]\nframes = 0\n", {"'frames'"});

  usage(kModel + "[camera]\n", {"line 3", "'position'"});
  usage(kModel + "[camera]\nposition = [0, 0, 1]\n", {"no 'target'"});
  usage(kModel + "[camera]\nposition = [0, 0, 1]\ntarget = [0, 0, 1]\n", {"same point"});
  usage(kModel + "[camera]\nposition = [0, 0, 1]\ntarget = [0, 0, 0]\norbit = {}\n", {"one of"});
  usage(kModel + "[camera]\nposition = [0, 0, 1]\ntarget = [0, 0, 0]\nfov = 3\nfocal = 3\n",
        {"leave one out"});
  usage(kModel + "[camera]\nposition = [0, 0, 1]\ntarget = [0, 0, 0]\nfov = 180\n", {"179"});
  usage(kModel + "[camera]\nposition = [0, 0, 1]\ntarget = [0, 0, 0]\nmodel = 'orthographic'\n",
        {"'extent'"});
  usage(kModel + "[camera]\nfile = 'model.ply'\nviews = [-1]\n", {"'views'"});
  usage(kModel + "[camera]\norbit = {frames = 2.9}\n", {"'frames'", "whole number"});
  usage(kModel + "[camera]\norbit = {frames = 0}\n", {"'frames'"});

  for (const std::string& text :
       {std::string("[[model]]\nfile = 'none.ply'\n"), std::string("[[mesh]]\nfile = 'none.ply'\n"),
        kModel + "[camera]\nfile = 'none.ply'\n", kModel + "[camera]\ndata = 'none.ply'\n",
        kModel + "[environment]\nimage = 'none.ply'\n",
        kMesh + material + "texture = 'none.ply'\n"}) {
    const std::string message = folder.refused<DataError>(text);
    INFO(message);
    CHECK(contains(message, "scene.toml, line "));
    CHECK(contains(message, "none.ply does not exist"));
  }
  CHECK_THROWS_AS(read_scene_file(folder.scratch() / "absent.toml"), DataError);
}

TEST_CASE("scene file: keys of any number of parts end in a sentence") {
  const SceneFolder folder;
  const auto parts = [](int count) {
    std::string key = "a";
    for (int i = 1; i < count; ++i) key += ".a";
    return key;
  };
  const auto refusal = [&](const std::string& text) {
    const std::string message = folder.refused<UsageError>(text);
    CHECK(!contains(message, "\n"));
    return message;
  };
  for (const int count : {65, 32000}) {
    CAPTURE(count);
    for (const std::string& line :
         {parts(count) + " = 1", "[" + parts(count) + "]", "[[" + parts(count) + "]]",
          "x = { " + parts(count) + " = 1 }", "'a'.\"b.\\\"\" . " + parts(count - 2) + " = 1",
          "x = [{}, { b = 2, " + parts(count) + " = 1 }]"}) {
      CHECK(contains(refusal("\n" + line + "\n"),
                     "scene.toml, line 2: a key has more than 64 parts"));
    }
  }
  // Tables in tables count together.
  std::string inner = "1";
  for (int i = 0; i < 200; ++i) inner = "{ " + parts(60) + " = " + inner + " }";
  CHECK(contains(refusal("x = " + inner + "\n"), "line 1: a key has more than 64 parts"));
  // What is no key may have any number of dots.
  const std::string dots(500, '.');
  std::string values;
  for (int i = 0; i < 200; ++i) values += "1.5, 1979-05-27T07:32:00.5, ";
  for (const std::string& line :
       {parts(64) + " = 1", "x = '" + dots + "'", "x = \"\"\"" + dots + "\n" + dots + "\"\"\"",
        "x = 1 # " + parts(500), "x = [" + values + "]", "'" + dots + "' = 1",
        "x = [{" + parts(50) + " = 1}, {" + parts(50) + " = 1}]"}) {
    CAPTURE(line);
    CHECK(contains(refusal(line + "\n"), "unknown key"));
  }
}
