// SPDX-License-Identifier: Apache-2.0
#include "io/mesh/mesh_builder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <glm/geometric.hpp>

#include "raysplats/error.hpp"
#include "scene/mesh/polygon.hpp"

namespace raysplats::io {
namespace {

/// Cutting ears takes quadratic time on the worst polygons.
constexpr std::size_t kMaxPolygon = 4096;
/// Looks at corners for each triangle that a mesh may have: a second or two for one that stands
/// alone, enough for thousands of polygons of a hundred corners, but only for some ten of
/// kMaxPolygon where half of the corners are reflex.
constexpr std::size_t kMostWork = 64;

}  // namespace

void MeshBuilder::check_room(std::size_t vertices, std::size_t triangles) const {
  const auto fits = [this](std::size_t has, std::size_t more) {
    return more <= most_ && has <= most_ - more;
  };
  if (fits(vertex_count(), vertices) && fits(triangle_count(), triangles)) return;
  throw DataError(fmt::format(
      "The mesh {} has more than {} million vertices or triangles: make it smaller or split it",
      path_.string(), most_ >> 20));
}

std::uint32_t MeshBuilder::add_vertex(const std::array<float, 3>& position,
                                      const std::optional<std::array<float, 3>>& normal,
                                      const std::optional<std::array<float, 2>>& uv) {
  check_room(1, 0);
  const auto index = static_cast<std::uint32_t>(mesh_.vertex_count());
  const auto put = [](std::vector<float>& values, const auto& numbers) {
    values.insert(values.end(), numbers.begin(), numbers.end());
  };
  put(mesh_.positions, position);
  put(mesh_.normals, normal.value_or(std::array<float, 3>{0, 0, 0}));
  put(mesh_.uvs, uv.value_or(std::array<float, 2>{0, 0}));
  has_normal_.push_back(normal.has_value());
  has_uv_.push_back(uv.has_value());
  return index;
}

void MeshBuilder::add_polygon(std::span<const std::uint32_t> vertices, std::uint32_t material) {
  if (vertices.size() > kMaxPolygon) {
    throw DataError(
        fmt::format("The mesh {} has a face with {} corners, more than {}: triangulate it first",
                    path_.string(), vertices.size(), kMaxPolygon));
  }
  check_room(0, vertices.size() - 2);
  if (vertices.size() == 3) {
    mesh_.triangles.insert(mesh_.triangles.end(), vertices.begin(), vertices.end());
    mesh_.materials.push_back(material);
    return;
  }
  corners_.clear();
  for (const std::size_t vertex : vertices) {
    const float* p = &mesh_.positions[3 * vertex];
    corners_.emplace_back(p[0], p[1], p[2]);
  }
  for (const auto& triangle : triangulate(corners_, &work_)) {
    for (const std::size_t corner : triangle) mesh_.triangles.push_back(vertices[corner]);
    mesh_.materials.push_back(material);
  }
  if (work_ / kMostWork > most_) {
    throw DataError(
        fmt::format("The mesh {} has faces of many corners that take too long to cut: triangulate "
                    "them first",
                    path_.string()));
  }
}

void MeshBuilder::append(const Mesh& part) {
  check_room(part.vertex_count(), part.triangle_count());
  const auto first = static_cast<std::uint32_t>(mesh_.vertex_count());
  const auto add = [](std::vector<float>& to, const std::vector<float>& from, std::size_t size) {
    to.insert(to.end(), from.begin(), from.end());
    if (from.empty()) to.resize(to.size() + size, 0.0f);
  };
  add(mesh_.positions, part.positions, 0);
  add(mesh_.normals, part.normals, 3 * part.vertex_count());
  add(mesh_.uvs, part.uvs, 2 * part.vertex_count());
  has_normal_.resize(has_normal_.size() + part.vertex_count(), !part.normals.empty());
  has_uv_.resize(has_uv_.size() + part.vertex_count(), !part.uvs.empty());
  for (const std::uint32_t vertex : part.triangles) mesh_.triangles.push_back(first + vertex);
  mesh_.materials.insert(mesh_.materials.end(), part.materials.begin(), part.materials.end());
}

std::vector<bool> MeshBuilder::bare() const {
  std::vector<bool> result(mesh_.triangle_count());
  for (std::size_t i = 0; i < mesh_.triangles.size(); ++i)
    if (!has_uv_[mesh_.triangles[i]]) result[i / 3] = true;
  return result;
}

Mesh MeshBuilder::finish() {
  const bool has_uvs = std::find(has_uv_.begin(), has_uv_.end(), true) != has_uv_.end();
  if (!has_uvs) mesh_.uvs.clear();
  const auto with_normal = std::count(has_normal_.begin(), has_normal_.end(), true);
  if (with_normal == 0) {
    mesh_.normals.clear();
    return std::move(mesh_);
  }
  if (static_cast<std::size_t>(with_normal) == has_normal_.size()) return std::move(mesh_);
  // The first triangle at a vertex keeps it, the others get copies of it.
  std::vector<bool> taken(mesh_.vertex_count(), false);
  for (std::size_t triangle = 0; triangle < mesh_.triangle_count(); ++triangle) {
    std::array<glm::dvec3, 3> p;
    for (std::size_t k = 0; k < 3; ++k) {
      const float* at = &mesh_.positions[3 * std::size_t{mesh_.triangles[3 * triangle + k]}];
      p[k] = {at[0], at[1], at[2]};
    }
    const glm::dvec3 normal = glm::cross(p[1] - p[0], p[2] - p[0]);
    const double length = glm::length(normal);
    const glm::dvec3 unit = length > 0.0 ? normal / length : glm::dvec3(0.0, 0.0, 1.0);
    for (std::size_t k = 0; k < 3; ++k) {
      std::uint32_t& corner = mesh_.triangles[3 * triangle + k];
      const std::size_t vertex = corner;
      if (has_normal_[vertex]) continue;
      std::size_t own = vertex;
      if (taken[vertex]) {
        check_room(1, 0);
        own = mesh_.vertex_count();
        for (std::size_t c = 0; c < 3; ++c) {
          mesh_.positions.push_back(mesh_.positions[3 * vertex + c]);
          mesh_.normals.push_back(0.0f);
        }
        for (std::size_t c = 0; has_uvs && c < 2; ++c) {
          mesh_.uvs.push_back(mesh_.uvs[2 * vertex + c]);
        }
        corner = static_cast<std::uint32_t>(own);
      } else {
        taken[vertex] = true;
      }
      for (int c = 0; c < 3; ++c) {
        mesh_.normals[3 * own + static_cast<std::size_t>(c)] = static_cast<float>(unit[c]);
      }
    }
  }
  return std::move(mesh_);
}

}  // namespace raysplats::io
