// SPDX-License-Identifier: Apache-2.0
#include "io/scene/scene_loader.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <random>
#include <sstream>
#include <string>
#include <vector>

#include "raysplats/io.hpp"
#include "reference/scenes.hpp"
#include "unit/io/scratch.hpp"
#include "unit/log_capture.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

/// Two triangles of a bent sheet, one per material; the second has a texture.
constexpr const char* kSheet =
    "mtllib sheet.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\nvt 1 0\nvt 0 1\n"
    "usemtl Plain\nf 1/1 2/2 3/3\nusemtl Printed\nf 1/1 3/2 4/3\n";
constexpr const char* kMaterials =
    "newmtl Plain\nKd 0.1 0.2 0.3\nnewmtl Printed\nKd 1 1 1\nmap_Kd print.png\n";

class Folder {
 public:
  Folder() {
    write_ply(scratch_ / "a.ply", reference::random_scene(40, 1, 1));
    write_ply(scratch_ / "b.ply", reference::random_scene(10, 2, 3));
    write_bytes(scratch_ / "sheet.obj", kSheet);
    write_bytes(scratch_ / "sheet.mtl", kMaterials);
    write_image(scratch_ / "print.png", Image(4, 2, 3, 0.5f));
    write_image(scratch_ / "grey.png", Image(3, 3, 1, 1.0f));
    write_image(scratch_ / "sky.exr", Image(8, 4, 4, 2.0f));
  }
  LoadedScene load(const std::string& text) const { return load_scene(read(text)); }
  SceneFile read(const std::string& text) const {
    write_bytes(scratch_ / "scene.toml", text);
    return read_scene_file(scratch_ / "scene.toml");
  }
  const Scratch& scratch() const { return scratch_; }

 private:
  Scratch scratch_;
};

const std::string kCamera = "[camera]\nposition = [0, 0, -3]\ntarget = [0, 0, 0]\nwidth = 40\n";

std::vector<float> sorted_x(const Gaussians& model, double scale, double offset) {
  std::vector<float> out;
  for (std::size_t i = 0; i < model.size(); ++i) {
    out.push_back(static_cast<float>(scale * model.means[3 * i] + offset));
  }
  std::sort(out.begin(), out.end());
  return out;
}

}  // namespace

TEST_CASE("scene loader: models are placed and joined") {
  const Folder folder;
  const LoadedScene loaded = folder.load(
      "[[model]]\nfile = 'a.ply'\n[[model]]\nfile = 'b.ply'\nscale = 2\ntranslate = [100, 0, 0]\n"
      "[[model]]\nfile = 'b.ply'\ntranslate = [200, 0, 0]\n" +
      kCamera);
  const Gaussians& all = loaded.scene.gaussians;
  CHECK(all.size() == 60);
  CHECK(all.sh_degree == 3);
  std::vector<float> expected = sorted_x(read_ply(folder.scratch() / "a.ply"), 1, 0);
  for (const auto& [scale, offset] : {std::pair{2.0, 100.0}, std::pair{1.0, 200.0}}) {
    const std::vector<float> more = sorted_x(read_ply(folder.scratch() / "b.ply"), scale, offset);
    expected.insert(expected.end(), more.begin(), more.end());
  }
  CHECK(sorted_x(all, 1, 0) == expected);
  CHECK(loaded.frames() == 1);
  CHECK(loaded.cameras[0].name == "frame_0000");
  CHECK(loaded.scene.meshes.empty());
  CHECK_FALSE(loaded.moves());
}

TEST_CASE("scene loader: materials and textures of meshes and of the scene") {
  const Folder folder;
  const LoadedScene loaded = folder.load(R"(
[[mesh]]
file = "sheet.obj"
[[mesh]]
file = "sheet.obj"
material = "chrome"
[[mesh]]
file = "sheet.obj"
material = { Printed = "paper" }
[[material]]
name = "chrome"
kind = "mirror"
[[material]]
name = "paper"
kind = "diffuse"
texture = "grey.png"
)" + kCamera);
  const Scene& scene = loaded.scene;
  REQUIRE(scene.meshes.size() == 3);
  REQUIRE(scene.materials.size() == 4);
  const auto material = [&](std::size_t mesh, std::size_t triangle) {
    return scene.materials.at(scene.meshes[mesh].materials.at(triangle));
  };
  CHECK(material(0, 0).name == "Plain");
  CHECK(material(0, 1).name == "Printed");
  CHECK(material(1, 0).name == "chrome");
  CHECK(material(1, 1).name == "chrome");
  CHECK(material(1, 1).kind == Material::Kind::kMirror);
  CHECK(material(2, 0).name == "Plain");
  CHECK(material(2, 1).name == "paper");
  REQUIRE(scene.textures.size() == 2);
  for (const Image& texture : scene.textures) CHECK(texture.channels == 3);
  CHECK(scene.textures.at(static_cast<std::size_t>(material(0, 1).texture)).width == 4);
  CHECK(scene.textures.at(static_cast<std::size_t>(material(2, 1).texture)).width == 3);
  CHECK(material(0, 0).texture == -1);

  const SceneFile wrong = folder.read(
      "[[mesh]]\nfile = 'sheet.obj'\nmaterial = { Plane = 'm' }\n[[material]]\nname = "
      "'m'\nkind = 'mirror'\n" +
      kCamera);
  std::string message;
  try {
    load_scene(wrong);
  } catch (const UsageError& error) {
    message = error.what();
  }
  INFO(message);
  CHECK(contains(message, "line 1"));
  CHECK(contains(message, "'Plain'"));
}

TEST_CASE("scene loader: pictures of materials that are replaced everywhere are not looked for") {
  const Folder folder;
  fs::remove(folder.scratch() / "print.png");
  const std::string paper = "[[material]]\nname = 'paper'\nkind = 'diffuse'\n" + kCamera;
  const std::string whole = "[[mesh]]\nfile = 'sheet.obj'\nmaterial = 'paper'\n";
  const std::string part = "[[mesh]]\nfile = 'sheet.obj'\nmaterial = { Printed = 'paper' }\n";
  for (const std::string& replaced : {whole, part, whole + part}) {
    CAPTURE(replaced);
    const Scene scene = folder.load(replaced + paper).scene;
    CHECK(scene.textures.empty());
    CHECK(scene.materials.at(scene.meshes[0].materials.at(1)).name == "paper");
  }
  const std::string other = "[[mesh]]\nfile = 'sheet.obj'\nmaterial = { Plain = 'paper' }\n";
  for (const std::string& seen : {other, whole + other})
    CHECK(contains(data_error([&] { folder.load(seen + paper); }), "print.png"));
}

TEST_CASE(
    "scene loader: triangles without texture coordinates have no texture, which is told once") {
  const Folder folder;
  const std::string corners = "mtllib sheet.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nvt 0 0\n";
  write_bytes(folder.scratch() / "bare.obj", corners + "usemtl Printed\nf 1 2 3\nf 1 3 4\n");
  write_bytes(folder.scratch() / "part.obj", corners + "usemtl Printed\nf 1/1 2/1 3/1\nf 1 3 4\n");
  const std::string camera =
      "[[material]]\nname = 'paper'\nkind = 'diffuse'\ntexture = 'grey.png'\n" + kCamera;
  const auto textured = [](const Scene& scene, std::size_t mesh, std::size_t triangle) {
    return scene.materials.at(scene.meshes.at(mesh).materials.at(triangle)).texture >= 0;
  };
  const std::string sheet = "[[mesh]]\nfile = 'sheet.obj'\nmaterial = 'paper'\n";
  for (const std::string material : {"", "material = 'paper'\n"}) {
    CAPTURE(material);
    for (const std::string file : {"bare.obj", "part.obj"}) {
      CAPTURE(file);
      const std::string mesh = "[[mesh]]\nfile = '" + file + "'\n" + material;
      const LogCapture log;
      const Scene scene = folder.load(mesh + mesh + sheet + camera).scene;
      CHECK(log.lines() == 1);
      CHECK(log.contains(file + ": the texture of the material '" +
                         (material.empty() ? "Printed" : "paper") + "' is left out"));
      for (const std::size_t copy : {0u, 1u}) {
        CHECK(textured(scene, copy, 0) == (file == "part.obj"));
        CHECK_FALSE(textured(scene, copy, 1));
      }
      // The other mesh keeps it.
      CHECK(textured(scene, 2, 0));
      CHECK(textured(scene, 2, 1));
    }
  }
  const LogCapture log;
  folder.load(sheet + camera);
  folder.load(
      "[[mesh]]\nfile = 'bare.obj'\nmaterial = 'm'\n[[material]]\nname = 'm'\nkind = "
      "'mirror'\n" +
      kCamera);
  CHECK(log.lines() == 0);
}

TEST_CASE("scene loader: meshes without texture coordinates share materials without textures") {
  const Folder folder;
  for (const std::string file : {"one.obj", "two.obj"})
    write_bytes(folder.scratch() / file, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
  const std::string one = "[[mesh]]\nfile = 'one.obj'\nmaterial = 'pane'\n";
  const std::string two = "[[mesh]]\nfile = 'two.obj'\nmaterial = 'pane'\n";
  const std::string pane =
      "[[material]]\nname = 'pane'\nkind = 'glass'\ntexture = 'grey.png'\n" + kCamera;
  const LogCapture once;
  const std::size_t materials = folder.load(one + pane).scene.materials.size();
  CHECK(once.lines() == 2);  // the texture, and the open glass
  {
    const LogCapture log;
    CHECK(folder.load(one + one + one + pane).scene.materials.size() == materials);
    CHECK(log.lines() == 2);
  }
  const LogCapture log;
  folder.load(one + two + one + pane);
  for (const std::string file : {"one.obj", "two.obj"}) {
    CHECK(log.contains(file + ": the texture of the material 'pane' is left out"));
    CHECK(log.contains(file + ": the glass of the material 'pane' is open"));
  }
  CHECK(log.lines() == 4);
}

TEST_CASE("scene loader: normals and placement of meshes") {
  const Folder folder;
  const LoadedScene loaded = folder.load(R"(
[[mesh]]
file = "sheet.obj"
normals = "flat"
translate = [0, 0, 5]
[[mesh]]
file = "sheet.obj"
normals = "smooth"
[[mesh]]
file = "sheet.obj"
normals = "smooth"
crease-angle = 60
[[mesh]]
file = "sheet.obj"
normals = "smooth"
scale = [1, 1, 3]
)" + kCamera);
  const std::vector<Mesh>& meshes = loaded.scene.meshes;
  CHECK(meshes[0].normals.empty());
  CHECK(meshes[0].positions[2] == 5.0f);
  // The sheet is bent by a right angle along an edge: one normal there, or two above the crease.
  const auto is = [&](const Mesh& mesh, std::size_t corner, const std::vector<double>& n) {
    const std::size_t v = mesh.triangles[corner];
    double error = 0.0;
    for (std::size_t k = 0; k < 3; ++k) {
      error = std::max(error, std::abs(static_cast<double>(mesh.normals[3 * v + k]) - n[k]));
    }
    return error < 1e-6;
  };
  const double half = std::sqrt(0.5);
  CHECK(is(meshes[1], 0, {half, 0, half}));
  CHECK(is(meshes[2], 0, {0, 0, 1}));
  CHECK(is(meshes[2], 3, {1, 0, 0}));
  // Edges are weighted by the angles they have in the world.
  CHECK(is(meshes[3], 0, {half, 0, half}));
}

TEST_CASE("scene loader: frames of an animation") {
  const Folder folder;
  const LoadedScene loaded = folder.load(
      "[[mesh]]\nfile = 'sheet.obj'\nmove = [8, 0, 0]\n[[mesh]]\nfile = 'sheet.obj'\n"
      "[animation]\nframes = 4\n" +
      kCamera);
  CHECK(loaded.moves());
  REQUIRE(loaded.frames() == 4);
  CHECK(loaded.cameras[3].name == "frame_0003");
  for (int frame = 0; frame < 4; ++frame) {
    const std::vector<Mesh> meshes = loaded.meshes(frame);
    REQUIRE(meshes.size() == 2);
    CHECK(meshes[0].positions[0] == doctest::Approx(2.0 * frame));
    CHECK(meshes[1].positions[0] == 0.0f);
  }
  // Cameras in turn; a still scene has as many frames as cameras.
  const std::string orbit = "[[mesh]]\nfile = 'sheet.obj'\n[camera]\norbit = { frames = 3 }\n";
  const LoadedScene turns = folder.load(orbit + "[animation]\nframes = 5\n");
  REQUIRE(turns.frames() == 5);
  CHECK(turns.cameras[4].translation == turns.cameras[1].translation);
  CHECK(turns.cameras[4].name == "frame_0004");
  CHECK(folder.load(orbit).frames() == 3);
  // Around the sheet, where there are no Gaussians.
  CHECK(glm::length(turns.extent.center - glm::dvec3(0.5)) < 1e-6);
  CHECK(turns.extent.radius == doctest::Approx(0.5 * std::sqrt(3.0)));
}

TEST_CASE("scene loader: environment, sizes and options") {
  const Folder folder;
  const std::string model = "[[model]]\nfile = 'a.ply'\n";
  SceneFile file = folder.read(model + "[environment]\nimage = 'sky.exr'\nexposure = 2\n" +
                               kCamera + "up = [0, 0, 1]\nheight = 20\n");
  const Environment sky = load_scene(file).scene.environment;
  CHECK(sky.color == Rgb{4, 4, 4});
  CHECK(sky.equirect.channels == 3);
  // The curve goes on above white.
  CHECK(sky.equirect.data[0] == doctest::Approx(1.055 * std::pow(2.0, 1 / 2.4) - 0.055));
  CHECK(sky.up == std::array<float, 3>{0, 0, 1});

  file = folder.read(model + "[trace]\nbackground = [1, 0.5, 0]\nmax-hits = 7\n" + kCamera +
                     "height = 20\n");
  file.trained.hit_order = HitOrder::kPeak;
  file.width = 20;
  const LoadedScene loaded = load_scene(file);
  CHECK(loaded.scene.environment.color == Rgb{1, 0.5f, 0});
  CHECK(loaded.scene.environment.equirect.data.empty());
  CHECK(loaded.scene.environment.up == std::array<float, 3>{0, -1, 0});
  CHECK(loaded.scene.trace.max_hits == 7);
  CHECK(loaded.scene.trace.hit_order == HitOrder::kPeak);
  CHECK(loaded.cameras[0].width == 20);
  CHECK(loaded.cameras[0].height == 10);
  file.width.reset();
  file.downscale = 4;
  CHECK(load_scene(file).cameras[0].width == 10);
}

TEST_CASE("scene loader: environments and textures of light show as those of display values") {
  const Folder folder;
  Image display(4, 2, 3), light(4, 2, 3);
  for (std::size_t i = 0; i < display.data.size(); ++i) {
    const double value = 0.1 * static_cast<double>(i);  // to 2.3
    display.data[i] = static_cast<float>(value);
    light.data[i] = static_cast<float>(value <= 0.04045 ? value / 12.92
                                                        : std::pow((value + 0.055) / 1.055, 2.4));
  }
  const fs::path& scratch = folder.scratch().path();
  write_image(scratch / "display.exr", display, {}, ColorSpace::kDisplay);
  write_image(scratch / "light.exr", light, {}, ColorSpace::kLinear);
  write_image(scratch / "unsaid.exr", light);
  write_bytes(scratch / "exr.obj",
              "mtllib exr.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl a\nf 1 2 3\n");
  for (const std::string name : {"display.exr", "light.exr", "unsaid.exr"}) {
    CAPTURE(name);
    write_bytes(scratch / "exr.mtl", "newmtl a\nmap_Kd " + name + "\n");
    const Scene scene =
        folder
            .load(
                "[[mesh]]\nfile = 'exr.obj'\n[[material]]\nname = 'own'\nkind = 'mirror'\n"
                "texture = '" +
                name + "'\n[environment]\nimage = '" + name + "'\n" + kCamera)
            .scene;
    REQUIRE(scene.textures.size() == 2);
    for (const Image* picture :
         {&scene.environment.equirect, &scene.textures[0], &scene.textures[1]}) {
      REQUIRE(picture->data.size() == display.data.size());
      for (std::size_t i = 0; i < display.data.size(); ++i)
        CHECK(std::abs(picture->data[i] - display.data[i]) < 1e-5f);
    }
  }
}

TEST_CASE("scene loader: texels that no light can have are brought into range and told of") {
  const Folder folder;
  const float infinity = std::numeric_limits<float>::infinity();
  Image sun(5, 1, 3, 1.0f);
  sun.data[0] = -1e-3f;
  sun.data[3] = 2e6f;
  sun.data[4] = infinity;
  sun.data[7] = std::numeric_limits<float>::quiet_NaN();
  sun.data[9] = -infinity;
  const std::string text =
      "[[mesh]]\nfile = 'sheet.obj'\n[environment]\nimage = 'sun.exr'\n" + kCamera;
  for (const ColorSpace space : {ColorSpace::kDisplay, ColorSpace::kLinear}) {
    write_image(folder.scratch() / "sun.exr", sun, {}, space);
    const LogCapture log;
    const std::vector<float> data = folder.load(text).scene.environment.equirect.data;
    const double most =
        space == ColorSpace::kDisplay ? 1e6 : 1.055 * std::pow(1e6, 1 / 2.4) - 0.055;
    const std::vector<double> expected{0, 1, 1, most, most, 1, 1, 0, 1, 0, 1, 1, 1, 1, 1};
    REQUIRE(data.size() == expected.size());
    for (std::size_t i = 0; i < data.size(); ++i) CHECK(data[i] == doctest::Approx(expected[i]));
    CHECK(log.contains("sun.exr"));
    CHECK(log.contains("4 of 5 texels"));
  }
  const LogCapture log;
  folder.load("[[mesh]]\nfile = 'sheet.obj'\n[environment]\nimage = 'sky.exr'\n" + kCamera);
  CHECK(log.lines() == 0);
}

TEST_CASE("scene loader: open glass that bends or absorbs light is told of, once") {
  const Folder folder;
  write_bytes(folder.scratch() / "wedge.obj",
              "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n");
  const auto told = [&](const std::string& file, const std::string& glass) {
    const std::string mesh = "[[mesh]]\nfile = '" + file + "'\nmaterial = 'pane'\n";
    const LogCapture log;
    folder.load(mesh + mesh + "[[material]]\nname = 'pane'\n" + glass + kCamera);
    CHECK(log.lines() == (log.contains("is open (4 edges") ? 1 : 0));
    return log.contains("sheet.obj: the glass of the material 'pane' is open (4 edges with one");
  };
  CHECK(told("sheet.obj", "kind = 'glass'\n"));
  CHECK(told("sheet.obj", "kind = 'glass'\nior = 1\nabsorption = 2\n"));
  CHECK_FALSE(told("sheet.obj", "kind = 'glass'\nior = 1\n"));
  CHECK_FALSE(told("sheet.obj", "kind = 'mirror'\n"));
  CHECK_FALSE(told("wedge.obj", "kind = 'glass'\n"));
}

TEST_CASE("scene loader: that scenes have no near limit is told where the model has one") {
  const Folder folder;
  const auto told = [&](const std::string& trace) {
    SceneFile file = folder.read("[[model]]\nfile = 'a.ply'\n" + kCamera + trace);
    file.trained.near_depth = 0.75f;
    const LogCapture log;
    load_scene(file);
    return log.contains("0.75") ? log.lines() : 0;
  };
  CHECK(told("") == 1);
  CHECK(told("[trace]\nnear = 0\n") == 0);
}

TEST_CASE("scene loader: an orbit around nothing has a camera") {
  const Folder folder;
  Gaussians nothing;
  nothing.resize(0);
  write_ply(folder.scratch() / "nothing.ply", nothing);
  const LoadedScene loaded =
      folder.load("[[model]]\nfile = 'nothing.ply'\n[camera]\norbit = { frames = 2 }\n");
  CHECK(loaded.frames() == 2);
  CHECK(loaded.extent.radius > 0.0);
  for (const Camera& camera : loaded.cameras) CHECK(std::isfinite(glm::length(camera.translation)));
}

TEST_CASE("scene loader: a smooth mesh can be turned, scaled and mirrored in every way") {
  const Folder folder;
  constexpr int kPlacements = 1000;
  constexpr const char* kWedge =
      "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n";
  write_bytes(folder.scratch() / "wedge.obj", kWedge);
  std::mt19937 random(7);
  const auto uniform = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  const auto factor = [&] {
    return (uniform(0, 1) < 0.3 ? -1 : 1) * std::pow(10.0, uniform(-4, 4));
  };
  std::ostringstream text;
  text.precision(17);
  const auto place = [&](const std::string& scale, const std::string& rotate, double crease) {
    text << "[[mesh]]\nfile = 'wedge.obj'\nnormals = 'smooth'\ncrease-angle = " << crease
         << "\nscale = " << scale << "\nrotate = " << rotate << "\ntranslate = ["
         << uniform(-50, 50) << ", " << uniform(-50, 50) << ", " << uniform(-50, 50) << "]\n";
  };
  const auto number = [](double value) {
    std::ostringstream out;
    out.precision(17);
    out << value;
    return out.str();
  };
  const auto triple = [&](const auto& next) {
    std::string list = "[" + number(next()) + ", ";
    list += number(next()) + ", ";
    return list + number(next()) + "]";
  };
  place("0.004", "[0, 0, 180]", 180);
  for (int i = 1; i < kPlacements; ++i) {
    const std::string scale = i % 2 == 0 ? number(factor()) : triple(factor);
    const std::string rotate =
        i % 3 == 0   ? triple([&] { return 90.0 * std::floor(uniform(-4, 5)); })
        : i % 3 == 1 ? triple([&] { return uniform(-360, 360); })
                     : "{ axis = " + triple([&] { return uniform(-1, 1) + 0.001; }) +
                           ", degrees = " + number(uniform(-720, 720)) + " }";
    place(scale, rotate, i % 4 == 0 ? 60 : 180);
  }
  const LoadedScene loaded = folder.load(text.str() + kCamera);
  REQUIRE(loaded.scene.meshes.size() == kPlacements);
  double worst = 0.0;
  int compared = 0;
  for (std::size_t i = 0; i < loaded.scene.meshes.size(); ++i) {
    const Mesh& placed = loaded.scene.meshes[i];
    const glm::dmat4& transform = loaded.placements[i].transform;
    REQUIRE(placed.normals.size() == placed.positions.size());
    REQUIRE(placed.triangle_count() == 4);
    // The mean of the unit normals of the placed faces, weighted by their angles, from the
    // vertices of the file in double precision.
    const std::vector<float>& corners = loaded.still[i].positions;
    glm::dvec3 world[4];
    glm::dvec3 middle(0.0);
    for (int v = 0; v < 4; ++v) {
      const std::size_t at = 3 * static_cast<std::size_t>(v);
      world[v] = glm::dmat3(transform) * glm::dvec3(corners[at], corners[at + 1], corners[at + 2]);
      middle += 0.25 * world[v];
    }
    // Split vertices have other means: at creases, and where normals of a sliver cancel out.
    if (placed.vertex_count() != 4) continue;
    for (int v = 0; v < 4; ++v) {
      glm::dvec3 expected(0.0);
      double weight = 0.0;
      for (int skipped = 0; skipped < 4; ++skipped) {
        if (skipped == v) continue;
        std::vector<glm::dvec3> others;
        for (int w = 0; w < 4; ++w) {
          if (w != v && w != skipped) others.push_back(world[w] - world[v]);
        }
        glm::dvec3 normal = glm::cross(others[0], others[1]);
        const double angle = std::atan2(glm::length(normal), glm::dot(others[0], others[1]));
        normal = glm::normalize(normal);
        if (glm::dot(normal, world[v] - middle) < 0.0) normal = -normal;
        expected += angle * normal;
        weight += angle;
      }
      // Where normals nearly cancel out, rounding decides.
      if (glm::length(expected) < 0.01 * weight) continue;
      ++compared;
      expected = glm::normalize(expected);
      glm::dvec3 actual;
      for (int c = 0; c < 3; ++c) {
        actual[c] = placed.normals[3 * static_cast<std::size_t>(v) + static_cast<std::size_t>(c)];
      }
      worst = std::max(worst, glm::length(actual - expected));
    }
  }
  MESSAGE("largest difference of a normal: ", worst);
  CHECK(worst < 1e-5);
  CHECK(compared > 2 * kPlacements);
}
