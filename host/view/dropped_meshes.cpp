// SPDX-License-Identifier: Apache-2.0
#include "view/dropped_meshes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "io/scene/scene_file.hpp"
#include "raysplats/error.hpp"
#include "scene/mesh/mesh.hpp"
#include "util/json_text.hpp"

namespace raysplats::view {
namespace {

using Json = nlohmann::json;

constexpr double kCrease = 40.0;  // degrees, beyond which edges stay sharp

struct SurfaceName {
  const char* message;   ///< in messages of the page
  const char* material;  ///< in scene files
};
constexpr std::array<SurfaceName, 3> kNames{
    {{"mirror", "page-mirror"}, {"glass", "page-glass"}, {"diffuse", "page-diffuse"}}};

const SurfaceName& name_of(Surface surface) { return kNames[static_cast<std::size_t>(surface)]; }

Json vector_json(const glm::dvec3& v) { return {v.x, v.y, v.z}; }

std::string list(const glm::dvec3& v) { return fmt::format("[{}, {}, {}]", v.x, v.y, v.z); }

std::string material_text(const Material& material) {
  std::string text = fmt::format("\n[[material]]\nname = {}\n", quoted(material.name));
  const auto& [r, g, b] = material.color;
  if (material.kind == Material::Kind::kGlass) {
    text += fmt::format("kind = \"glass\"\nior = {}\n", material.ior);
  } else {
    text += fmt::format("kind = \"{}\"\n",
                        material.kind == Material::Kind::kMirror ? "mirror" : "diffuse");
  }
  return text + fmt::format("color = [{}, {}, {}]\n", r, g, b);
}

}  // namespace

std::string quoted(const std::string& text) {
  // What JSON escapes, TOML escapes alike, but for this.
  std::string out = json_text(Json(text));
  for (std::size_t at; (at = out.find('\x7f')) != std::string::npos;) out.replace(at, 1, "\\u007f");
  return out;
}

std::vector<Material> surface_materials() {
  std::vector<Material> out(kNames.size());
  for (std::size_t i = 0; i < out.size(); ++i) out[i].name = kNames[i].material;
  Material& mirror = out[static_cast<std::size_t>(Surface::kMirror)];
  mirror.kind = Material::Kind::kMirror;
  mirror.color = {0.95f, 0.95f, 0.95f};
  Material& glass = out[static_cast<std::size_t>(Surface::kGlass)];
  glass.kind = Material::Kind::kGlass;
  glass.color = {1.0f, 1.0f, 1.0f};
  return out;
}

Light page_light(const glm::dvec3& up) {
  const glm::dvec3 aside =
      std::abs(up.x) < std::abs(up.z) ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 0, 1);
  const glm::dvec3 direction = glm::normalize(0.5 * aside - glm::normalize(up));
  Light light;
  light.kind = Light::Kind::kDirectional;
  for (std::size_t k = 0; k < 3; ++k)
    light.direction[k] = static_cast<float>(direction[static_cast<int>(k)]);
  return light;
}

double DroppedMeshes::Dropped::scale() const { return placement.size / half; }

glm::dvec3 DroppedMeshes::Dropped::translation() const {
  const glm::dmat4 turn = scene_transform(glm::dvec3(scale()), placement.rotate, glm::dvec3(0.0));
  return placement.at - glm::dvec3(turn * glm::dvec4(middle, 1.0));
}

DroppedMeshes::DroppedMeshes(Show show, std::string head, std::string tail)
    : show_(std::move(show)), head_(std::move(head)), tail_(std::move(tail)) {}

void DroppedMeshes::add(SentMesh sent) {
  if (meshes_.size() >= kMostMeshes) {
    throw UsageError(
        fmt::format("There are {} meshes already: remove one, or write a scene file", kMostMeshes));
  }
  Dropped added{};
  added.mesh = io::read_mesh_alone(sent.offer.format, std::move(sent.bytes), sent.offer.name);
  glm::dvec3 low(std::numeric_limits<double>::infinity());
  glm::dvec3 high = -low;
  const std::vector<float>& p = added.mesh.positions;
  for (std::size_t i = 0; i < p.size(); i += 3) {
    const glm::dvec3 corner(p[i], p[i + 1], p[i + 2]);
    low = glm::min(low, corner);
    high = glm::max(high, corner);
  }
  added.middle = 0.5 * (low + high);
  added.half = 0.5 * glm::distance(low, high);
  if (!(added.half > 0.0))
    throw DataError(fmt::format("The mesh {} is a single point", sent.offer.name));
  added.smooth = added.mesh.normals.empty();
  if (added.smooth) add_smooth_normals(added.mesh, kCrease);
  added.number = ++last_;
  added.name = sent.offer.name;
  added.placement = sent.offer.placement;
  meshes_.push_back(std::move(added));
  try {
    show();
  } catch (...) {
    meshes_.pop_back();
    throw;
  }
}

void DroppedMeshes::place(std::uint32_t mesh, const Placement& placement) {
  Dropped& dropped = find(mesh);
  const Placement before = std::exchange(dropped.placement, placement);
  try {
    show();
  } catch (...) {
    dropped.placement = before;
    throw;
  }
}

void DroppedMeshes::remove(std::uint32_t mesh) {
  const auto at = meshes_.begin() + (&find(mesh) - meshes_.data());
  Dropped removed = std::move(*at);
  const auto behind = meshes_.erase(at);
  try {
    show();
  } catch (...) {
    meshes_.insert(behind, std::move(removed));
    throw;
  }
}

DroppedMeshes::Dropped& DroppedMeshes::find(std::uint32_t mesh) {
  const auto found = std::find_if(meshes_.begin(), meshes_.end(),
                                  [&](const Dropped& each) { return each.number == mesh; });
  if (found == meshes_.end())
    throw UsageError(fmt::format("There is no mesh {} any more: it has been removed", mesh));
  return *found;
}

void DroppedMeshes::show() const {
  std::vector<Mesh> world;
  world.reserve(meshes_.size());
  for (const Dropped& each : meshes_) {
    world.push_back(transformed(
        each.mesh,
        scene_transform(glm::dvec3(each.scale()), each.placement.rotate, each.translation())));
    world.back().materials.assign(each.mesh.triangle_count(),
                                  static_cast<std::uint32_t>(each.placement.surface));
  }
  show_(world);
}

std::string DroppedMeshes::json() const {
  Json list = Json::array();
  for (const Dropped& each : meshes_) {
    list.push_back({{"mesh", each.number},
                    {"name", each.name},
                    {"triangles", each.mesh.triangle_count()},
                    {"material", name_of(each.placement.surface).message},
                    {"at", vector_json(each.placement.at)},
                    {"rotate", vector_json(each.placement.rotate)},
                    {"size", each.placement.size}});
  }
  return json_text(nlohmann::json{{"type", "meshes"}, {"meshes", list}});
}

std::string DroppedMeshes::scene_text(const Camera& camera) const {
  std::string text = head_;
  std::array<bool, kNames.size()> used{};
  for (const Dropped& each : meshes_) {
    used[static_cast<std::size_t>(each.placement.surface)] = true;
    text += fmt::format(
        "\n[[mesh]]\nfile = {}\nscale = {}\nrotate = {}\ntranslate = {}\nmaterial = {}\n",
        quoted(each.name), each.scale(), list(each.placement.rotate), list(each.translation()),
        quoted(name_of(each.placement.surface).material));
    if (each.smooth) text += fmt::format("normals = \"smooth\"\ncrease-angle = {}\n", kCrease);
  }
  const std::vector<Material> materials = surface_materials();
  for (std::size_t i = 0; i < used.size(); ++i) {
    if (used[i]) text += material_text(materials[i]);
  }
  if (tail_.empty()) return text;
  const glm::dmat3 axes = glm::transpose(camera.rotation);
  return text + tail_ +
         fmt::format(
             "\n[camera]\nposition = {}\ntarget = {}\nup = {}\nfocal = {}\nwidth = {}\n"
             "height = {}\n",
             list(camera.center()), list(camera.center() + axes[2]), list(-axes[1]), camera.fy,
             camera.width, camera.height);
}

}  // namespace raysplats::view
