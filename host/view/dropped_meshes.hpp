// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "raysplats/scene.hpp"
#include "view/mesh_uploads.hpp"
#include "view/view_request.hpp"

namespace raysplats::view {

constexpr std::size_t kMostMeshes = 8;

/// The materials of dropped meshes, in the order of Surface, under names of their own.
std::vector<Material> surface_materials();

/// The light on meshes that are dropped into a model, from above and a little aside.
Light page_light(const glm::dvec3& up);

/// Meshes that pages have dropped into what is shown, by numbers from 1 on.
class DroppedMeshes {
 public:
  /// Shows exactly these, in the world, with materials that index surface_materials(). Throws
  /// where it cannot; then it shows what it showed before.
  using Show = std::function<void(const std::vector<Mesh>& meshes)>;

  /// `head` begins scene_text(), `tail` ends it.
  DroppedMeshes(Show show, std::string head, std::string tail);

  /// Parses and places a mesh. Throws DataError for one that is damaged, UsageError for one too
  /// many, and what `show` throws; nothing has changed then.
  void add(SentMesh sent);
  /// Moves mesh number `mesh`. Throws UsageError where there is none of that number, and what
  /// `show` throws; nothing has changed then.
  void place(std::uint32_t mesh, const Placement& placement);
  /// Takes mesh number `mesh` away; throws as place().
  void remove(std::uint32_t mesh);

  /// The message {"type": "meshes"} for pages: number, name, triangles and placement of each.
  std::string json() const;
  /// A scene file that draws what is shown as `camera`, a pinhole, sees it, with the meshes' files
  /// beside it.
  std::string scene_text(const Camera& camera) const;

 private:
  struct Dropped {
    std::uint32_t number;
    std::string name;
    Mesh mesh;          ///< as in its file, with smooth normals where that has none
    bool smooth;        ///< whether they were made
    glm::dvec3 middle;  ///< of its box
    double half;        ///< of its box's diagonal
    Placement placement;
    double scale() const;
    glm::dvec3 translation() const;
  };
  Dropped& find(std::uint32_t mesh);
  void show() const;

  Show show_;
  std::string head_, tail_;
  std::vector<Dropped> meshes_;
  std::uint32_t last_ = 0;
};

/// The text in quotes, for TOML.
std::string quoted(const std::string& text);

}  // namespace raysplats::view
