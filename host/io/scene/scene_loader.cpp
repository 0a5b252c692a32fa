// SPDX-License-Identifier: Apache-2.0
#include "io/scene/scene_loader.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "io/mesh/mesh_file.hpp"
#include "io/mesh/texture_file.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "scene/gaussians/gaussian_transform.hpp"
#include "scene/mesh/mesh.hpp"
#include "scene/mesh/mesh_edges.hpp"
#include "scene/morton_order.hpp"
#include "util/nearest_name.hpp"

namespace raysplats {
namespace {

Gaussians load_gaussians(const SceneFile& file) {
  std::map<std::filesystem::path, Gaussians> read;
  std::vector<Gaussians> placed;
  for (const SceneModel& model : file.models) {
    const auto found = read.find(model.file);
    const Gaussians& gaussians =
        found != read.end() ? found->second
                            : read.emplace(model.file, read_model(model.file)).first->second;
    try {
      placed.push_back(transformed(gaussians, glm::translate(model.transform, model.offset)));
    } catch (const UsageError& error) {
      throw UsageError(fmt::format("{}: {}", model.place, error.what()));
    }
  }
  return in_morton_order(joined(placed));
}

/// A mesh file that is in the scene: its materials start at `first` of the scene's.
struct Loaded {
  Mesh mesh;
  std::vector<std::string> material_names;
  std::uint32_t first = 0;
  std::vector<bool> bare;  ///< as MeshFile::bare
};

/// Adds materials with their textures to the scene.
std::uint32_t append(Scene& scene, std::vector<Material> materials, std::vector<Image> textures) {
  const auto first = static_cast<std::uint32_t>(scene.materials.size());
  const auto texture = static_cast<int>(scene.textures.size());
  for (Material& material : materials) {
    if (material.texture >= 0) material.texture += texture;
    scene.materials.push_back(std::move(material));
  }
  for (Image& image : textures) scene.textures.push_back(std::move(image));
  return first;
}

std::uint32_t index_of(const Scene& scene, const std::string& name, std::size_t count) {
  std::size_t i = 0;
  while (i < count && scene.materials[i].name != name) ++i;
  return static_cast<std::uint32_t>(i);
}

/// Per material of the file its index in the scene: the file's own unless the scene file names
/// another. `own` is the number of [[material]] entries, which come first in the scene.
std::vector<std::uint32_t> material_map(const SceneMesh& entry,
                                        const Loaded& loaded,
                                        const Scene& scene,
                                        std::size_t own) {
  std::vector<std::uint32_t> map(loaded.material_names.size());
  for (std::size_t i = 0; i < map.size(); ++i) {
    map[i] = entry.material.empty() ? loaded.first + static_cast<std::uint32_t>(i)
                                    : index_of(scene, entry.material, own);
  }
  for (const auto& [from, to] : entry.materials) {
    bool used = false;
    for (std::size_t i = 0; i < map.size(); ++i) {
      if (loaded.material_names[i] != from) continue;
      map[i] = index_of(scene, to, own);
      used = true;
    }
    if (used) continue;
    throw UsageError(fmt::format("{}: {} has no material '{}'{}", entry.place, entry.file.string(),
                                 from, did_you_mean(from, loaded.material_names)));
  }
  return map;
}

/// Whether a mesh file's own material of that name is seen anywhere in the scene.
bool is_seen(const SceneFile& file, const std::filesystem::path& mesh, const std::string& name) {
  return std::any_of(file.meshes.begin(), file.meshes.end(), [&](const SceneMesh& entry) {
    return entry.file == mesh && entry.material.empty() &&
           std::none_of(entry.materials.begin(), entry.materials.end(),
                        [&](const auto& replaced) { return replaced.first == name; });
  });
}

/// Takes textures off triangles without texture coordinates, which would show one texel of them,
/// and warns of that once of every file.
class PlainMaterials {
 public:
  /// Gives `bare` triangles copies of their materials without textures: one of every material,
  /// whatever meshes have it.
  void put(const SceneMesh& entry,
           const std::vector<bool>& bare,
           Mesh& mesh,
           std::vector<Material>& materials) {
    std::optional<std::uint32_t> first;
    for (std::size_t i = 0; i < bare.size(); ++i) {
      const std::uint32_t material = mesh.materials[i];
      if (!bare[i] || materials[material].texture < 0) continue;
      if (!first) first = material;
      const auto [copy, added] =
          copies_.emplace(material, static_cast<std::uint32_t>(materials.size()));
      if (added) {
        materials.push_back(materials[material]);
        materials.back().texture = -1;
      }
      mesh.materials[i] = copy->second;
    }
    if (!first || !told_.insert(entry.file).second) return;
    spdlog::warn(
        "{}: the texture of the material '{}' is left out where there are no texture coordinates",
        entry.file.string(), materials[*first].name);
  }

 private:
  std::map<std::uint32_t, std::uint32_t> copies_;
  std::set<std::filesystem::path> told_;  ///< files
};

/// Whether light is bent or absorbed within a body.
bool has_inside(const Material& material) {
  return material.kind == Material::Kind::kGlass &&
         (material.ior != 1.0f || material.absorption != Rgb{0, 0, 0});
}

/// Warns of glass that light may enter but not leave again, once of every material of a file.
class OpenGlass {
 public:
  void warn(const SceneMesh& entry, const Mesh& mesh, const std::vector<Material>& materials) {
    std::vector<bool> used(materials.size());
    for (const std::uint32_t material : mesh.materials) used[material] = true;
    std::set<std::uint32_t> unknown;
    for (std::uint32_t i = 0; i < used.size(); ++i) {
      if (used[i] && has_inside(materials[i]) && known_.emplace(entry.file, i).second)
        unknown.insert(i);
    }
    if (unknown.empty()) return;
    for (const auto& [material, edges] : open_edges(mesh)) {
      if (!unknown.contains(material)) continue;
      spdlog::warn(
          "{}: the glass of the material '{}' is open ({} edges with one triangle): it has an "
          "inside only where it is closed",
          entry.file.string(), materials[material].name, edges);
    }
  }

 private:
  std::set<std::pair<std::filesystem::path, std::uint32_t>> known_;
};

void load_meshes(const SceneFile& file, LoadedScene& out) {
  for (const SceneMaterial& each : file.materials) {
    std::vector<Image> textures;
    Material material = each.material;
    if (!each.texture.empty()) {
      textures.push_back(io::read_texture(each.texture));
      material.texture = 0;
    }
    append(out.scene, {material}, std::move(textures));
  }
  const std::size_t own = out.scene.materials.size();
  std::map<std::filesystem::path, Loaded> read;
  OpenGlass open_glass;
  PlainMaterials plain;
  for (const SceneMesh& entry : file.meshes) {
    auto found = read.find(entry.file);
    if (found == read.end()) {
      io::MeshFile source = io::read_mesh(
          entry.file, [&](const std::string& name) { return is_seen(file, entry.file, name); });
      Loaded loaded;
      loaded.mesh = std::move(source.mesh);
      loaded.bare = std::move(source.bare);
      for (const Material& each : source.materials) loaded.material_names.push_back(each.name);
      loaded.first = append(out.scene, std::move(source.materials), std::move(source.textures));
      found = read.emplace(entry.file, std::move(loaded)).first;
    }
    Mesh mesh = found->second.mesh;
    const std::vector<std::uint32_t> map = material_map(entry, found->second, out.scene, own);
    for (std::uint32_t& material : mesh.materials) material = map.at(material);
    plain.put(entry, found->second.bare, mesh, out.scene.materials);
    open_glass.warn(entry, mesh, out.scene.materials);
    if (entry.normals == SceneMesh::Normals::kFlat) mesh.normals.clear();
    if (entry.normals == SceneMesh::Normals::kSmooth) {
      // Edges are as sharp as they are in the world.
      add_smooth_normals(mesh, entry.crease_angle, glm::dmat3(entry.transform));
    }
    out.still.push_back(std::move(mesh));
    out.placements.push_back(entry);
  }
}

/// Scenes leave out no Gaussians that are near to the camera, though a model may have been trained
/// so.
void tell_of_near_limit(const TraceOptions& trace) {
  if (trace.near_depth <= 0.0f) return;
  spdlog::warn(
      "the model leaves out Gaussians nearer than {:g} to the camera, but scenes show them: rays "
      "that leave a mirror have no camera that could be near",
      trace.near_depth);
}

/// Where there are no Gaussians, the box around the meshes.
SceneExtent extent_of(const Scene& scene) {
  if (scene.gaussians.size() > 0) return scene_extent(scene.gaussians);
  glm::dvec3 low(std::numeric_limits<double>::infinity());
  glm::dvec3 high = -low;
  for (const Mesh& mesh : scene.meshes) {
    for (std::size_t i = 0; i < mesh.vertex_count(); ++i) {
      const glm::dvec3 corner(mesh.positions[3 * i], mesh.positions[3 * i + 1],
                              mesh.positions[3 * i + 2]);
      low = glm::min(low, corner);
      high = glm::max(high, corner);
    }
  }
  if (!(low.x <= high.x)) return {};
  const double radius = 0.5 * glm::length(high - low);
  return {0.5 * (low + high), radius > 0.0 ? radius : 1.0};
}

Environment load_environment(const SceneFile& file, const TraceOptions& trace) {
  const SceneEnvironment& from = file.environment;
  Environment out;
  const bool image = !from.image.empty();
  const bool sky = !image && !from.color && !trace.sky.empty();
  if (sky) out.sky = trace.sky;
  out.color = from.color.value_or(image || sky ? Rgb{1, 1, 1} : trace.background);
  for (float& c : out.color) c *= std::exp2(from.exposure);
  if (image) out.equirect = io::read_texture(from.image);
  const glm::dvec3 up = from.up.value_or(file.camera.up.value_or(glm::dvec3(0, -1, 0)));
  for (std::size_t k = 0; k < 3; ++k) out.up[k] = static_cast<float>(up[static_cast<int>(k)]);
  out.rotation = from.rotation;
  return out;
}

/// One camera per frame, named as its picture where every frame has a camera of its own.
std::vector<Camera> frame_cameras(const SceneFile& file, const SceneExtent& extent) {
  constexpr int kOrbitFrames = 60;
  const std::vector<Camera> cameras =
      scene_cameras(file.camera, extent, file.frames.value_or(kOrbitFrames), file.trained_data);
  const std::size_t frames = file.frames ? static_cast<std::size_t>(*file.frames) : cameras.size();
  std::vector<Camera> out;
  out.reserve(frames);
  for (std::size_t i = 0; i < frames; ++i) {
    const Camera& camera = cameras[i % cameras.size()];
    out.push_back(downscaled(resized(camera, file.width, file.height), file.downscale));
    if (frames > cameras.size() || out.back().name.empty()) {
      out.back().name = fmt::format("frame_{:04d}", i);
    }
  }
  return out;
}

}  // namespace

bool LoadedScene::moves() const {
  return std::any_of(placements.begin(), placements.end(),
                     [](const SceneMesh& mesh) { return mesh.moves(); });
}

std::vector<Mesh> LoadedScene::meshes(double frame) const {
  const double time = frames() > 0 ? frame / frames() : 0.0;
  std::vector<Mesh> out;
  out.reserve(still.size());
  for (std::size_t i = 0; i < still.size(); ++i) {
    out.push_back(transformed(still[i], placements[i].placement(time)));
  }
  return out;
}

LoadedScene load_scene(const SceneFile& file) {
  LoadedScene out;
  out.scene.gaussians = load_gaussians(file);
  load_meshes(file, out);
  out.scene.meshes = out.meshes(0);
  out.scene.lights = file.lights;
  out.scene.render = file.render;
  out.scene.trace = file.trace.over(file.trained);
  tell_of_near_limit(out.scene.trace);
  out.scene.environment = load_environment(file, out.scene.trace);
  out.extent = extent_of(out.scene);
  out.cameras = frame_cameras(file, out.extent);
  return out;
}

}  // namespace raysplats
