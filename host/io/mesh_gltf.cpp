// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec4.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "core/mesh.hpp"
#include "io/gltf_materials.hpp"
#include "io/gltf_model.hpp"
#include "io/mesh_builder.hpp"
#include "io/mesh_file.hpp"

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
  explicit SceneWalk(const GltfReader& reader)
      : reader_(reader),
        materials_(reader),
        builder_(reader.path()),
        parts_(reader.model().meshes.size()) {}

  MeshFile run() {
    const tinygltf::Model& model = reader_.model();
    if (model.nodes.empty()) {
      for (std::size_t i = 0; i < model.meshes.size(); ++i) {
        place(static_cast<int>(i), glm::dmat4(1.0));
      }
    }
    std::vector<std::pair<int, glm::dmat4>> open;
    for (const int root : roots()) open.emplace_back(root, glm::dmat4(1.0));
    std::vector<bool> seen(model.nodes.size(), false);
    while (!open.empty()) {
      const auto [number, parent] = open.back();
      open.pop_back();
      if (number < 0 || static_cast<std::size_t>(number) >= model.nodes.size()) {
        reader_.fail(fmt::format("there is no node {}", number));
      }
      // Nodes are a forest; anything else would never end, or grow without bounds.
      if (seen[static_cast<std::size_t>(number)]) {
        reader_.fail(fmt::format("the node {} has two parents", number));
      }
      seen[static_cast<std::size_t>(number)] = true;
      const tinygltf::Node& node = model.nodes[static_cast<std::size_t>(number)];
      const glm::dmat4 matrix = parent * local(node, number);
      if (node.mesh >= 0) place(node.mesh, matrix);
      for (const int child : node.children) open.emplace_back(child, matrix);
    }
    for (const auto& [mesh, matrix] : placed_) {
      for (const Mesh& part : *parts_[mesh]) builder_.append(transformed(part, matrix));
    }
    MeshFile file;
    file.mesh = builder_.finish();
    file.materials = std::move(materials_.materials);
    file.textures = std::move(materials_.textures);
    return file;
  }

 private:
  /// The nodes of the default scene, of the first one without a default, or all that are no
  /// children.
  std::vector<int> roots() const {
    const tinygltf::Model& model = reader_.model();
    if (!model.scenes.empty()) {
      const int scene = std::max(model.defaultScene, 0);
      if (static_cast<std::size_t>(scene) >= model.scenes.size()) {
        reader_.fail(fmt::format("there is no scene {}", scene));
      }
      return model.scenes[static_cast<std::size_t>(scene)].nodes;
    }
    std::vector<bool> is_child(model.nodes.size(), false);
    for (const tinygltf::Node& node : model.nodes) {
      for (const int child : node.children) {
        if (child >= 0 && static_cast<std::size_t>(child) < is_child.size()) {
          is_child[static_cast<std::size_t>(child)] = true;
        }
      }
    }
    std::vector<int> result;
    for (std::size_t i = 0; i < is_child.size(); ++i) {
      if (!is_child[i]) result.push_back(static_cast<int>(i));
    }
    return result;
  }

  glm::dmat4 local(const tinygltf::Node& node, int number) const {
    const auto check = [&](const char* what, const std::vector<double>& values, std::size_t size) {
      if (!values.empty() && values.size() != size) {
        reader_.fail(fmt::format("the {} of the node {} has {} numbers, not {}", what, number,
                                 values.size(), size));
      }
      return !values.empty();
    };
    glm::dmat4 matrix(1.0);
    if (check("matrix", node.matrix, 16)) {
      for (int i = 0; i < 16; ++i) matrix[i / 4][i % 4] = node.matrix[static_cast<std::size_t>(i)];
      if (glm::dvec4(matrix[0][3], matrix[1][3], matrix[2][3], matrix[3][3]) !=
          glm::dvec4(0.0, 0.0, 0.0, 1.0)) {
        reader_.fail(
            fmt::format("the matrix of the node {} has another last row than 0 0 0 1", number));
      }
      return matrix;
    }
    if (check("rotation", node.rotation, 4)) {
      const glm::dquat q(node.rotation[3], node.rotation[0], node.rotation[1], node.rotation[2]);
      if (!(glm::length(q) > 0.0)) {
        reader_.fail(fmt::format("the rotation of the node {} is zero", number));
      }
      matrix = glm::mat4_cast(glm::normalize(q));
    }
    if (check("scale", node.scale, 3)) {
      for (int i = 0; i < 3; ++i) matrix[i] *= node.scale[static_cast<std::size_t>(i)];
    }
    if (check("translation", node.translation, 3)) {
      matrix[3] = glm::dvec4(node.translation[0], node.translation[1], node.translation[2], 1.0);
    }
    return matrix;
  }

  void place(int mesh, const glm::dmat4& matrix) {
    if (static_cast<std::size_t>(mesh) >= parts_.size()) {
      reader_.fail(fmt::format("there is no mesh {}", mesh));
    }
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

  /// The accessor of an attribute, -1 for none.
  static int attribute(const tinygltf::Primitive& primitive, const std::string& name) {
    const auto found = primitive.attributes.find(name);
    return found == primitive.attributes.end() ? -1 : found->second;
  }

  Mesh read(const tinygltf::Primitive& primitive) {
    Mesh part;
    const int positions = attribute(primitive, "POSITION");
    if (positions < 0) reader_.fail("a primitive has no POSITION");
    part.positions = reader_.floats(positions, 3);
    const int normals = attribute(primitive, "NORMAL");
    if (normals >= 0) part.normals = reader_.floats(normals, 3);
    const std::uint32_t material = materials_.index(primitive.material);
    const GltfTextureUse use = materials_.texture_use(primitive.material);
    const int uvs = use.attribute.empty() ? -1 : attribute(primitive, use.attribute);
    if (uvs >= 0) {
      part.uvs = reader_.floats(uvs, 2);
      const double c = std::cos(use.rotation);
      const double s = std::sin(use.rotation);
      for (std::size_t i = 0; i + 1 < part.uvs.size(); i += 2) {
        const double u = static_cast<double>(part.uvs[i]) * use.scale[0];
        const double v = static_cast<double>(part.uvs[i + 1]) * use.scale[1];
        // Counter-clockwise in the image, whose v axis points down.
        part.uvs[i] = static_cast<float>(use.offset[0] + c * u + s * v);
        part.uvs[i + 1] = static_cast<float>(use.offset[1] - s * u + c * v);
      }
    }
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

  const GltfReader& reader_;
  GltfMaterials materials_;
  MeshBuilder builder_;
  std::vector<std::optional<std::vector<Mesh>>> parts_;     ///< of meshes, once they are used
  std::vector<std::pair<std::size_t, glm::dmat4>> placed_;  ///< meshes of nodes
  std::size_t vertices_ = 0;                                ///< of all that are placed
  std::size_t triangles_ = 0;
};

}  // namespace

MeshFile read_gltf(const std::filesystem::path& path) {
  const tinygltf::Model model = parse_gltf(path);
  const GltfReader reader(model, path);
  return SceneWalk(reader).run();
}

}  // namespace raysplats::io
