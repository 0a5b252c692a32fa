// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "raysplats/scene.hpp"

namespace raysplats::io {

/// Most vertices, and most triangles, of a mesh and the files beside it.
constexpr std::size_t kMostTogether = std::size_t{1} << 27;

/// Puts a mesh together whose parts may or may not have normals and texture coordinates. A vertex
/// without a normal among others that have one is flat in every triangle (glTF 2.0, section
/// 3.7.2.1); a missing texture coordinate is (0, 0).
class MeshBuilder {
 public:
  /// `path` names the file in errors; `most` vertices, and as many triangles, are taken.
  MeshBuilder(std::filesystem::path path, std::size_t most) : path_(std::move(path)), most_(most) {}

  std::size_t vertex_count() const { return mesh_.vertex_count(); }
  std::size_t triangle_count() const { return mesh_.triangle_count(); }

  /// Throws DataError where this many more would be too many. Instances of one mesh make small
  /// files large, so ask before placing them.
  void check_room(std::size_t vertices, std::size_t triangles) const;
  std::uint32_t add_vertex(const std::array<float, 3>& position,
                           const std::optional<std::array<float, 3>>& normal,
                           const std::optional<std::array<float, 2>>& uv);
  /// A polygon of at least three vertices, all added before, is triangulated. Throws DataError
  /// where its triangles are too many, or all polygons together take too long to cut.
  void add_polygon(std::span<const std::uint32_t> vertices, std::uint32_t material);
  /// A whole mesh whose arrays fit each other and whose indices are in range.
  void append(const Mesh& part);
  /// Per triangle so far whether a corner has no texture coordinates.
  std::vector<bool> bare() const;
  Mesh finish();

 private:
  std::filesystem::path path_;
  std::size_t most_;
  Mesh mesh_;  ///< with normals and uvs for every vertex
  std::vector<bool> has_normal_;
  std::vector<bool> has_uv_;
  std::size_t work_ = 0;             ///< of cutting polygons
  std::vector<glm::dvec3> corners_;  ///< of the polygon being added
};

}  // namespace raysplats::io
