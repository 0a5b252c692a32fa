// SPDX-License-Identifier: Apache-2.0
#include "io/scene/scene_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/matrix.hpp>
#include <initializer_list>

#include "io/toml_table.hpp"
#include "raysplats/error.hpp"
#include "scene/options/render_option_table.hpp"
#include "util/nearest_name.hpp"

namespace raysplats {
namespace {

using io::TomlTable;
using Kind = Material::Kind;

constexpr double kHuge = 1e30;

Rgb rgb(const glm::dvec3& v) {
  return {static_cast<float>(v.x), static_cast<float>(v.y), static_cast<float>(v.z)};
}

glm::dmat4 turned(double degrees, const glm::dvec3& axis) {
  return glm::rotate(glm::dmat4(1.0), glm::radians(degrees), glm::normalize(axis));
}

glm::dmat4 turned(const glm::dvec3& angles) {
  return turned(angles.z, {0, 0, 1}) * turned(angles.y, {0, 1, 0}) * turned(angles.x, {1, 0, 0});
}

glm::dmat4 read_rotation(TomlTable& table) {
  if (table.is_table("rotate")) {
    TomlTable rotate = *table.table("rotate");
    const auto axis = rotate.direction("axis");
    const auto degrees = rotate.number("degrees", -kHuge, kHuge);
    if (!axis || !degrees) table.fail("rotate", "'rotate' needs both 'axis' and 'degrees'");
    rotate.finish();
    return turned(*degrees, *axis);
  }
  const auto angles = table.vector("rotate");
  return angles ? turned(*angles) : glm::dmat4(1.0);
}

glm::dvec3 read_scale(TomlTable& table) {
  if (table.is_number("scale")) return glm::dvec3(*table.number("scale", -kHuge, kHuge));
  return table.vector("scale").value_or(glm::dvec3(1.0));
}

/// Scale, then rotation, then translation; or a matrix.
glm::dmat4 read_transform(TomlTable& table) {
  const auto offset = table.vector("translate");
  const bool turns = table.has("rotate");
  const bool scales = table.has("scale");
  if (const auto rows = table.numbers("matrix", 16)) {
    if (offset || turns || scales) {
      table.fail("matrix", fmt::format("'matrix' in {} stands alone: leave out 'translate', "
                                       "'rotate' and 'scale'",
                                       table.name()));
    }
    glm::dmat4 out;
    for (std::size_t i = 0; i < 16; ++i) {
      out[static_cast<int>(i % 4)][static_cast<int>(i / 4)] = (*rows)[i];
    }
    if (glm::transpose(out)[3] != glm::dvec4(0, 0, 0, 1) || glm::determinant(out) == 0.0) {
      table.fail("matrix", fmt::format("'matrix' in {} has to be invertible with 0, 0, 0, 1 as its "
                                       "last row (it is written row by row)",
                                       table.name()));
    }
    return out;
  }
  const glm::dvec3 scale = read_scale(table);
  if (scale.x == 0.0 || scale.y == 0.0 || scale.z == 0.0) {
    table.fail("scale", fmt::format("'scale' in {} must not be 0", table.name()));
  }
  return glm::translate(glm::dmat4(1.0), offset.value_or(glm::dvec3(0.0))) * read_rotation(table) *
         glm::scale(glm::dmat4(1.0), scale);
}

std::filesystem::path required_file(TomlTable& table) {
  const auto file = table.existing("file");
  if (!file) {
    table.fail("", fmt::format("{} has no 'file': name the file to read", table.name()));
  }
  return *file;
}

SceneModel read_model(TomlTable& table) {
  SceneModel model;
  model.place = table.place();
  model.file = required_file(table);
  model.transform = read_transform(table);
  table.finish();
  return model;
}

SceneMesh read_mesh_entry(TomlTable& table) {
  SceneMesh mesh;
  mesh.place = table.place();
  mesh.file = required_file(table);
  mesh.transform = read_transform(table);
  if (table.is_table("material")) {
    mesh.materials = table.table("material")->texts();
  } else {
    mesh.material = table.text("material").value_or("");
  }
  table.choice<SceneMesh::Normals>("normals", mesh.normals,
                                   {{"file", SceneMesh::Normals::kFile},
                                    {"smooth", SceneMesh::Normals::kSmooth},
                                    {"flat", SceneMesh::Normals::kFlat}});
  const bool smooth = mesh.normals == SceneMesh::Normals::kSmooth;
  if (smooth) table.number("crease-angle", mesh.crease_angle, 0, 180);
  table.only_for("crease-angle", smooth, "normals = \"smooth\"");
  mesh.move = table.vector("move").value_or(mesh.move);
  if (auto turn = table.table("turn")) {
    const auto axis = turn->direction("axis");
    const auto degrees = turn->number("degrees", -kHuge, kHuge);
    if (!axis || !degrees) table.fail("turn", "'turn' needs both 'axis' and 'degrees'");
    mesh.turn_axis = *axis;
    mesh.turn_degrees = *degrees;
    mesh.pivot = turn->vector("pivot");
    turn->finish();
  }
  table.finish();
  return mesh;
}

SceneMaterial read_material(TomlTable& table) {
  SceneMaterial out;
  out.place = table.place();
  Material& m = out.material;
  m.name = table.text("name").value_or("");
  if (m.name.empty()) table.fail("name", "[[material]] has no 'name' for meshes to use it by");
  if (!table.has("kind")) {
    table.fail("name", fmt::format("the [[material]] '{}' has no 'kind': diffuse, mirror, glass, "
                                   "transparent or emissive",
                                   m.name));
  }
  table.choice<Kind>("kind", m.kind,
                     {{"diffuse", Kind::kDiffuse},
                      {"mirror", Kind::kMirror},
                      {"glass", Kind::kGlass},
                      {"transparent", Kind::kTransparent},
                      {"emissive", Kind::kEmissive}});
  // A key that the kind ignores is a mistake, so each kind asks for its own only.
  const bool lit = m.kind == Kind::kDiffuse || m.kind == Kind::kTransparent;
  if (m.kind == Kind::kMirror || m.kind == Kind::kGlass) m.color = {1, 1, 1};
  if (m.kind != Kind::kEmissive) {
    table.vector("color", m.color, 0, 1);
    out.texture = table.existing("texture").value_or("");
  }
  if (lit) table.number("specular", m.specular, 0, 1e3);
  if (lit || m.kind == Kind::kMirror) table.number("roughness", m.roughness, 0, 1);
  if (m.kind == Kind::kGlass) {
    table.number("ior", m.ior, 0.01, 100);
    table.vector("absorption", m.absorption, 0, kMaxColor);
  }
  if (m.kind == Kind::kTransparent) table.number("opacity", m.opacity, 0, 1);
  const auto is = [&](std::initializer_list<Kind> kinds) {
    return std::find(kinds.begin(), kinds.end(), m.kind) != kinds.end();
  };
  table.only_for("color", !is({Kind::kEmissive}),
                 "a kind other than emissive, which has 'emission'");
  table.only_for("texture", !is({Kind::kEmissive}), "a kind other than emissive");
  table.only_for("specular", lit, "the kinds diffuse and transparent");
  table.only_for("roughness", lit || is({Kind::kMirror}),
                 "the kinds diffuse, transparent and mirror");
  table.only_for("ior", is({Kind::kGlass}), "kind = \"glass\"");
  table.only_for("absorption", is({Kind::kGlass}), "kind = \"glass\"");
  table.only_for("opacity", is({Kind::kTransparent}), "kind = \"transparent\"");
  table.vector("emission", m.emission, 0, kMaxColor);
  if (const auto shadow = table.number("shadow", 0, 1)) m.shadow = static_cast<float>(*shadow);
  table.finish();
  return out;
}

Light read_light(TomlTable& table) {
  Light light;
  if (!table.has("kind")) {
    table.fail("", "[[light]] has no 'kind': point, directional or sphere");
  }
  table.choice<Light::Kind>("kind", light.kind,
                            {{"point", Light::Kind::kPoint},
                             {"directional", Light::Kind::kDirectional},
                             {"sphere", Light::Kind::kSphere}});
  const bool distant = light.kind == Light::Kind::kDirectional;
  const char* where = distant ? "direction" : "position";
  const auto vector = distant ? table.direction(where) : table.vector(where);
  if (!vector) table.fail("", fmt::format("this [[light]] has no '{}'", where));
  (distant ? light.direction : light.position) = rgb(distant ? glm::normalize(*vector) : *vector);
  table.vector("color", light.color, 0, kMaxColor);
  float intensity = 1.0f;
  table.number("intensity", intensity, 0, kHuge);
  for (float& c : light.color) c *= intensity;
  const bool sphere = light.kind == Light::Kind::kSphere;
  if (sphere) table.number("radius", light.radius, 0, kHuge);
  table.only_for("radius", sphere, "kind = \"sphere\"");
  table.only_for("direction", distant, "kind = \"directional\"");
  table.only_for("position", !distant, "the kinds point and sphere");
  table.finish();
  return light;
}

SceneEnvironment read_environment(TomlTable& table) {
  SceneEnvironment out;
  if (table.has("color")) {
    out.color.emplace();
    table.vector("color", *out.color, 0, kMaxColor);
  }
  out.image = table.existing("image").value_or("");
  table.number("exposure", out.exposure, -30, 30);
  out.up = table.direction("up");
  table.number("rotation", out.rotation, -kHuge, kHuge);
  table.finish();
  return out;
}

void read_rows(TomlTable& table, const std::vector<OptionRow>& rows) {
  for (const OptionRow& row : rows) table.option(row.name, row.set);
}

RenderSettings read_render(TomlTable& table) {
  RenderSettings r;
  read_rows(table, render_option_rows(r));
  if (auto shadows = table.table("shadows")) {
    read_rows(*shadows, shadow_option_rows(r.shadows));
    shadows->finish();
  }
  table.finish();
  return r;
}

TraceSettings read_trace(TomlTable& table) {
  TraceSettings t;
  if (table.has("q") && table.has("quantile")) {
    table.fail("q", "'q' and 'quantile' in [trace] say the same: leave one out");
  }
  const auto read = [&](const char* key, const char* name) {
    table.option(key, [&](const std::vector<std::string>& values) { t.set(name, values); });
  };
  read("q", "quantile");
  for (const char* name : {"quantile", "min-transmittance", "max-hits", "hit-order",
                           "adaptive-radius", "near", "view-footprint", "traversal", "background",
                           "packet-width", "packet-shape", "memory-budget", "launch-budget-ms"}) {
    read(name, name);
  }
  const TraceOptions given = t.over({});
  if (given.near_depth != 0) {
    table.fail(
        "near",
        "'near' in [trace] can only be 0: rays that leave a mirror have no camera that could "
        "be near");
  }
  try {
    check_packet_width(given);
  } catch (const UsageError& error) {
    table.fail("packet-width", error.what());
  }
  table.finish();
  return t;
}

/// Names are unique, and every mesh names materials that are there.
void check_materials(const SceneFile& scene) {
  std::vector<std::string> names;
  for (const SceneMaterial& each : scene.materials) {
    if (std::find(names.begin(), names.end(), each.material.name) != names.end()) {
      throw UsageError(fmt::format("{}: there are two [[material]] called '{}': rename one",
                                   each.place, each.material.name));
    }
    names.push_back(each.material.name);
  }
  const auto check = [&](const SceneMesh& mesh, const std::string& name) {
    if (std::find(names.begin(), names.end(), name) != names.end()) return;
    throw UsageError(fmt::format("{}: there is no [[material]] '{}' in this file{}", mesh.place,
                                 name, did_you_mean(name, names)));
  };
  for (const SceneMesh& mesh : scene.meshes) {
    if (!mesh.material.empty()) check(mesh, mesh.material);
    for (const auto& [own, name] : mesh.materials) check(mesh, name);
  }
}

}  // namespace

glm::dmat4 scene_transform(const glm::dvec3& scale,
                           const glm::dvec3& rotate,
                           const glm::dvec3& translate) {
  return glm::translate(glm::dmat4(1.0), translate) * turned(rotate) *
         glm::scale(glm::dmat4(1.0), scale);
}

glm::dmat4 SceneMesh::placement(double time) const {
  if (!moves()) return transform;
  const glm::dvec3 center = pivot.value_or(glm::dvec3(transform[3]));
  const glm::dmat4 identity(1.0);
  return glm::translate(identity, time * move + center) * turned(time * turn_degrees, turn_axis) *
         glm::translate(identity, -center) * transform;
}

bool is_scene_file(const std::filesystem::path& path) { return path.extension() == ".toml"; }

SceneFile read_scene_file(const std::filesystem::path& path) {
  const toml::table root = io::read_toml(path);
  TomlTable table(root, path, "the scene file");
  SceneFile scene;
  scene.path = path;
  scene.camera.place = path.string();
  for (TomlTable& each : table.list("model")) scene.models.push_back(read_model(each));
  for (TomlTable& each : table.list("mesh")) scene.meshes.push_back(read_mesh_entry(each));
  for (TomlTable& each : table.list("material")) scene.materials.push_back(read_material(each));
  for (TomlTable& each : table.list("light")) scene.lights.push_back(read_light(each));
  if (auto found = table.table("environment")) scene.environment = read_environment(*found);
  if (auto found = table.table("camera")) scene.camera = read_scene_camera(*found);
  if (auto found = table.table("render")) scene.render = read_render(*found);
  if (auto found = table.table("trace")) scene.trace = read_trace(*found);
  if (auto found = table.table("animation")) {
    if (found->has("frames")) found->number("frames", scene.frames.emplace(), 1, 1e6);
    found->finish();
  }
  table.finish();
  if (scene.models.empty() && scene.meshes.empty()) {
    throw UsageError(
        fmt::format("{} shows nothing: add a [[model]] of Gaussians or a [[mesh]]", path.string()));
  }
  check_materials(scene);
  return scene;
}

}  // namespace raysplats
