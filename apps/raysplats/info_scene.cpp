// SPDX-License-Identifier: Apache-2.0
#include "info_scene.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "info_file.hpp"
#include "io/mesh/mesh_file.hpp"
#include "io/model/model_formats.hpp"
#include "io/ply_file.hpp"
#include "io/scene/scene_file.hpp"
#include "util/number_text.hpp"
#include "util/path_text.hpp"

namespace raysplats::cli {
namespace {

using Json = nlohmann::ordered_json;

const char* kind_name(Light::Kind kind) {
  switch (kind) {
    case Light::Kind::kDirectional:
      return "directional";
    case Light::Kind::kSphere:
      return "sphere";
    case Light::Kind::kPoint:
      break;
  }
  return "point";
}

const char* source_name(SceneCamera::Source source) {
  switch (source) {
    case SceneCamera::Source::kPlaced:
      return "placed";
    case SceneCamera::Source::kFile:
      return "file";
    case SceneCamera::Source::kData:
      return "data set";
    case SceneCamera::Source::kOrbit:
      return "orbit";
    case SceneCamera::Source::kGiven:
    case SceneCamera::Source::kNone:
      break;
  }
  return "none";
}

Json describe(const io::MeshFile& file) {
  Json materials = Json::array();
  for (const Material& material : file.materials) {
    materials.push_back({{"name", material.name}, {"kind", material_kind(material.kind)}});
  }
  return {{"triangles", file.mesh.triangle_count()},
          {"vertices", file.mesh.vertex_count()},
          {"bounds", bounds_of(file.mesh.positions)},
          {"normals", !file.mesh.normals.empty()},
          {"texture_coordinates", !file.mesh.uvs.empty()},
          {"textures", file.textures.size()},
          {"materials", materials}};
}

Json describe(const SceneFile& scene) {
  Json models = Json::array(), meshes = Json::array(), materials = Json::array();
  Json lights = Json::array();
  for (const SceneModel& model : scene.models) models.push_back(model.file.string());
  for (const SceneMesh& mesh : scene.meshes) {
    meshes.push_back({{"file", mesh.file.string()}, {"moves", mesh.moves()}});
  }
  for (const SceneMaterial& each : scene.materials) {
    materials.push_back(
        {{"name", each.material.name}, {"kind", material_kind(each.material.kind)}});
  }
  for (const Light& light : scene.lights) lights.push_back(kind_name(light.kind));
  Json camera{{"source", source_name(scene.camera.source)},
              {"model", model_name(scene.camera.model)}};
  if (!scene.camera.file.empty()) camera["file"] = scene.camera.file.string();
  if (scene.camera.frames) camera["frames"] = *scene.camera.frames;
  Json out{{"models", models},
           {"meshes", meshes},
           {"materials", materials},
           {"lights", lights},
           {"camera", camera},
           {"samples", scene.render.samples},
           {"max_bounces", scene.render.max_bounces}};
  if (scene.frames) out["animation_frames"] = *scene.frames;
  return out;
}

std::string named_kinds(const Json& materials) {
  std::vector<std::string> parts;
  for (const Json& material : materials) {
    const std::string name = material["name"];
    parts.push_back(fmt::format("{} ({})", name.empty() ? "unnamed" : name,
                                material["kind"].get<std::string>()));
  }
  return fmt::format("{}", fmt::join(parts, ", "));
}

// A PLY with faces and without opacities.
bool is_mesh_ply(const std::filesystem::path& path) {
  const io::PlyFile file(path);
  constexpr std::array<std::string_view, 2> kCorners{"vertex_indices", "vertex_index"};
  return !file.column("opacity") && file.later_rows("face") > 0 &&
         file.for_each_list("face", kCorners, [](std::size_t, std::span<const double>) {});
}

}  // namespace

bool is_mesh(const std::filesystem::path& path) {
  const std::string extension = lower_extension(path);
  if (extension == ".ply") return is_mesh_ply(path);
  if (extension == ".gltf" || extension == ".glb") return !io::has_gltf_gaussians(path);
  return extension == ".obj";
}

Json describe_mesh(const std::filesystem::path& path) {
  Json out{{"type", "mesh"}, {"path", path.string()}};
  out.update(describe(io::read_mesh(path)));
  return out;
}

void print_mesh(const Json& mesh) {
  const auto corner = [&](std::size_t i) {
    const Json& v = mesh["bounds"][i];
    return fmt::format("({:.4g}, {:.4g}, {:.4g})", v[0].get<float>(), v[1].get<float>(),
                       v[2].get<float>());
  };
  fmt::print("mesh             {}, {}\n", counted(mesh["triangles"].get<std::size_t>(), "triangle"),
             counted(mesh["vertices"].get<std::size_t>(), "vertex", "vertices"));
  fmt::print("bounds           {} to {}\n", corner(0), corner(1));
  fmt::print("normals          {}\n", mesh["normals"].get<bool>() ? "of the file" : "none: flat");
  fmt::print("texture          {}, {} coordinates\n",
             counted(mesh["textures"].get<std::size_t>(), "picture"),
             mesh["texture_coordinates"].get<bool>() ? "with" : "without");
  fmt::print("materials        {}\n", named_kinds(mesh["materials"]));
}

Json describe_scene(const std::filesystem::path& path) {
  Json out{{"type", "scene"}, {"path", path.string()}};
  out.update(describe(read_scene_file(path)));
  return out;
}

void print_scene(const Json& scene) {
  for (const Json& model : scene["models"]) {
    fmt::print("model            {}\n", model.get<std::string>());
  }
  for (const Json& mesh : scene["meshes"]) {
    fmt::print("mesh             {}{}\n", mesh["file"].get<std::string>(),
               mesh["moves"].get<bool>() ? " (moves)" : "");
  }
  if (!scene["materials"].empty()) {
    fmt::print("materials        {}\n", named_kinds(scene["materials"]));
  }
  fmt::print(
      "lights           {}\n",
      scene["lights"].empty()
          ? "none"
          : fmt::format("{}", fmt::join(scene["lights"].get<std::vector<std::string>>(), ", ")));
  const Json& camera = scene["camera"];
  fmt::print("camera           {}, {}{}\n", camera["source"].get<std::string>(),
             camera["model"].get<std::string>(),
             camera.contains("frames")
                 ? ", " + counted(camera["frames"].get<std::size_t>(), "frame")
                 : "");
  if (scene.contains("animation_frames")) {
    fmt::print("animation        {}\n",
               counted(scene["animation_frames"].get<std::size_t>(), "frame"));
  }
  fmt::print("samples          {} a pixel, {} at most\n", scene["samples"].get<int>(),
             counted(scene["max_bounces"].get<std::size_t>(), "bounce"));
}

}  // namespace raysplats::cli
