// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/mat4x4.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "io/gltf/gltf_document.hpp"
#include "io/gltf/gltf_materials.hpp"
#include "io/gltf/gltf_model.hpp"
#include "io/gltf/gltf_nodes.hpp"
#include "io/mesh/mesh_builder.hpp"
#include "io/mesh/mesh_file.hpp"
#include "raysplats/error.hpp"
#include "scene/mesh/mesh.hpp"

namespace raysplats::io {
namespace {

/// Corners of separate triangles from those of a primitive, without those of strips that only turn
/// the winding.
std::vector<std::uint32_t> separate(const std::vector<std::uint32_t>& corners,
                                    int mode,
                                    const GltfReader& reader) {
  if (mode == TINYGLTF_MODE_TRIANGLES) {
    if (corners.size() % 3 != 0) {
      reader.fail(fmt::format("{} corners make no whole number of triangles", corners.size()));
    }
    return corners;
  }
  std::vector<std::uint32_t> triangles;
  for (std::size_t i = 0; i + 2 < corners.size(); ++i) {
    const std::size_t odd = mode == TINYGLTF_MODE_TRIANGLE_STRIP ? i % 2 : 0;
    const std::size_t first = mode == TINYGLTF_MODE_TRIANGLE_STRIP ? i : 0;
    triangles.push_back(corners[first]);
    triangles.push_back(corners[i + 1 + odd]);
    triangles.push_back(corners[i + 2 - odd]);
  }
  return triangles;
}

/// Walks the scene and puts its primitives together.
class SceneWalk {
 public:
  SceneWalk(const GltfReader& reader, std::size_t most, SeenMaterials seen)
      : reader_(reader),
        seen_(std::move(seen)),
        materials_(reader, seen_),
        builder_(reader.path(), most),
        parts_(reader.model().meshes.size()) {}

  MeshFile run() {
    for_each_placed_mesh(reader_, [&](int mesh, const glm::dmat4& matrix) { place(mesh, matrix); });
    for (const auto& [mesh, matrix] : placed_) {
      for (const Mesh& part : *parts_[mesh]) builder_.append(transformed(part, matrix));
    }
    MeshFile file;
    file.bare = builder_.bare();
    file.mesh = builder_.finish();
    materials_.make_thin_glass(file.mesh);
    file.materials = std::move(materials_.materials);
    file.textures = std::move(materials_.textures);
    return file;
  }

 private:
  void place(int mesh, const glm::dmat4& matrix) {
    std::optional<std::vector<Mesh>>& parts = parts_[static_cast<std::size_t>(mesh)];
    if (!parts) {
      parts.emplace();
      const tinygltf::Mesh& from = reader_.model().meshes[static_cast<std::size_t>(mesh)];
      for (std::size_t i = 0; i < from.primitives.size(); ++i) {
        const tinygltf::Primitive& primitive = from.primitives[i];
        if (primitive.mode < TINYGLTF_MODE_TRIANGLES ||
            primitive.mode > TINYGLTF_MODE_TRIANGLE_FAN) {
          spdlog::warn("{}: primitive {} of mesh {} has no triangles and is left out",
                       reader_.path().string(), i, mesh);
          continue;
        }
        parts->push_back(read(primitive));
        validate(parts->back(), materials_.materials.size(),
                 fmt::format("{} (mesh {}, primitive {})", reader_.path().string(), mesh, i));
      }
    }
    for (const Mesh& part : *parts) {
      vertices_ += part.vertex_count();
      triangles_ += part.triangle_count();
    }
    builder_.check_room(vertices_, triangles_);
    placed_.emplace_back(static_cast<std::size_t>(mesh), matrix);
  }

  Mesh read(const tinygltf::Primitive& primitive) {
    Mesh part;
    const int positions = attribute(primitive, "POSITION");
    if (positions < 0) reader_.fail("a primitive has no POSITION");
    part.positions = reader_.floats(positions, 3);
    const int normals = attribute(primitive, "NORMAL");
    if (normals >= 0) part.normals = reader_.floats(normals, 3);
    const std::uint32_t material = materials_.index(primitive.material);
    warn_of_colors(primitive, materials_.materials[material].name);
    part.uvs = texture_coordinates(primitive, materials_.materials[material], part.vertex_count());
    std::vector<std::uint32_t> corners;
    if (primitive.indices >= 0) {
      corners = reader_.indices(primitive.indices);
    } else {
      for (std::size_t i = 0; i < part.vertex_count(); ++i) {
        corners.push_back(static_cast<std::uint32_t>(i));
      }
    }
    part.triangles = separate(corners, primitive.mode, reader_);
    part.materials.assign(part.triangle_count(), material);
    return part;
  }

  /// The texture coordinates of a primitive. Broken ones count as none where the file lays no
  /// texture with them.
  std::vector<float> texture_coordinates(const tinygltf::Primitive& primitive,
                                         const Material& material,
                                         std::size_t vertices) {
    const GltfTextureUse use = materials_.texture_use(primitive.material);
    const int accessor = attribute(primitive, use.attribute);
    if (accessor < 0) return {};
    std::vector<float> uvs;
    try {
      uvs = reader_.floats(accessor, 2);
    } catch (const DataError&) {
      if (material.texture >= 0) throw;
      return {};
    }
    const double c = std::cos(use.rotation);
    const double s = std::sin(use.rotation);
    for (std::size_t i = 0; i + 1 < uvs.size(); i += 2) {
      const double u = static_cast<double>(uvs[i]) * use.scale[0];
      const double v = static_cast<double>(uvs[i + 1]) * use.scale[1];
      // Counter-clockwise in the image, whose v axis points down.
      uvs[i] = static_cast<float>(use.offset[0] + c * u + s * v);
      uvs[i + 1] = static_cast<float>(use.offset[1] - s * u + c * v);
    }
    const bool fit = uvs.size() == 2 * vertices &&
                     std::all_of(uvs.begin(), uvs.end(), [](float x) { return std::isfinite(x); });
    if (material.texture < 0 && !fit) return {};
    warn_of_wrapping(use, uvs, material);
    return uvs;
  }

  /// Warns once of vertex colours.
  void warn_of_colors(const tinygltf::Primitive& primitive, const std::string& material) {
    if (warned_of_colors_ || attribute(primitive, "COLOR_0") < 0) return;
    if (seen_ && !seen_(material)) return;
    warned_of_colors_ = true;
    spdlog::warn("{}: the colours of its vertices are left out: it has those of its materials",
                 reader_.path().string());
  }

  /// Warns once of a texture that shows beyond its borders and should not repeat there.
  void warn_of_wrapping(const GltfTextureUse& use,
                        const std::vector<float>& uvs,
                        const Material& material) {
    constexpr float kRounding = 1e-3f;
    if (warned_of_wrapping_ || material.texture < 0) return;
    for (std::size_t i = 0; i < uvs.size(); ++i) {
      if (use.repeats[i % 2] || std::abs(uvs[i] - 0.5f) <= 0.5f + kRounding) continue;
      warned_of_wrapping_ = true;
      spdlog::warn("{}: the wrapping of the texture of the material '{}' is left out: it repeats",
                   reader_.path().string(), material.name);
      return;
    }
  }

  const GltfReader& reader_;
  SeenMaterials seen_;
  GltfMaterials materials_;
  MeshBuilder builder_;
  std::vector<std::optional<std::vector<Mesh>>> parts_;     ///< of meshes, once they are used
  std::vector<std::pair<std::size_t, glm::dmat4>> placed_;  ///< meshes of nodes
  std::size_t vertices_ = 0;                                ///< of all that are placed
  std::size_t triangles_ = 0;
  bool warned_of_colors_ = false;
  bool warned_of_wrapping_ = false;
};

}  // namespace

MeshFile read_gltf(MeshBytes file) {
  tinygltf::Model model = parse_gltf(file.path, file.bytes, file.alone);
  if (file.alone) {
    for (tinygltf::Mesh& mesh : model.meshes)
      for (tinygltf::Primitive& primitive : mesh.primitives) primitive.material = -1;
  }
  const GltfReader reader(model, file.path);
  return SceneWalk(reader, file.alone ? kMostAlone : kMostTogether, std::move(file.seen)).run();
}

}  // namespace raysplats::io
