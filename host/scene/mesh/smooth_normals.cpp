// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <glm/vec3.hpp>
#include <map>
#include <numbers>
#include <numeric>
#include <utility>
#include <vector>

#include "scene/mesh/mesh.hpp"
#include "scene/mesh/mesh_edges.hpp"

namespace raysplats {
namespace {

/// Disjoint sets with path halving (Tarjan and van Leeuwen 1984).
class Sets {
 public:
  explicit Sets(std::size_t count) : parent_(count) {
    std::iota(parent_.begin(), parent_.end(), std::size_t{0});
  }
  std::size_t find(std::size_t i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void join(std::size_t a, std::size_t b) { parent_[find(a)] = find(b); }

 private:
  std::vector<std::size_t> parent_;
};

/// Outward unit normals of the placed triangles (zero where there is no area) and the corners'
/// angles.
struct Faces {
  std::vector<glm::dvec3> normals;
  std::vector<double> angles;
};

Faces measure(const Mesh& mesh, const glm::dmat3& placement) {
  const double side = glm::determinant(placement) < 0.0 ? -1.0 : 1.0;
  Faces faces;
  faces.normals.resize(mesh.triangle_count(), glm::dvec3(0.0));
  faces.angles.resize(mesh.triangles.size(), 0.0);
  for (std::size_t triangle = 0; triangle < mesh.triangle_count(); ++triangle) {
    std::array<glm::dvec3, 3> p;
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t vertex = mesh.triangles[3 * triangle + k];
      p[k] = placement * glm::dvec3(static_cast<double>(mesh.positions[3 * vertex]),
                                    static_cast<double>(mesh.positions[3 * vertex + 1]),
                                    static_cast<double>(mesh.positions[3 * vertex + 2]));
    }
    const glm::dvec3 normal = side * glm::cross(p[1] - p[0], p[2] - p[0]);
    const double length = glm::length(normal);
    if (length > 0.0) faces.normals[triangle] = normal / length;
    for (std::size_t k = 0; k < 3; ++k) {
      const glm::dvec3 u = p[(k + 1) % 3] - p[k];
      const glm::dvec3 v = p[(k + 2) % 3] - p[k];
      faces.angles[3 * triangle + k] = std::atan2(length, glm::dot(u, v));
    }
  }
  return faces;
}

/// Joins the corners of triangles that meet in an edge below the crease angle: one normal for each
/// set.
Sets sets_of_corners(const Mesh& mesh, const Faces& faces, double crease_degrees) {
  const std::vector<MeshEdge> edges = sorted_edges(mesh);
  // The tolerance keeps an edge of exactly the crease angle smooth.
  const double least_cosine =
      std::cos(std::clamp(crease_degrees, 0.0, 180.0) * std::numbers::pi / 180.0) - 1e-6;
  Sets sets(mesh.triangles.size());
  for (std::size_t i = 1; i < edges.size(); ++i) {
    const MeshEdge& a = edges[i - 1];
    const MeshEdge& b = edges[i];
    if (a.low != b.low || a.high != b.high) continue;
    const glm::dvec3& na = faces.normals[a.low_corner / 3];
    const glm::dvec3& nb = faces.normals[b.low_corner / 3];
    const bool flat = na == glm::dvec3(0.0) || nb == glm::dvec3(0.0);
    if (!flat && glm::dot(na, nb) < least_cosine) continue;
    sets.join(a.low_corner, b.low_corner);
    sets.join(a.high_corner, b.high_corner);
  }
  return sets;
}

/// The normal of a corner, and the set of corners that share it.
struct CornerNormal {
  glm::dvec3 normal;
  std::size_t set;
};

/// Means over the sets of corners, weighted by the corners' angles; not of unit length.
std::vector<CornerNormal> corner_normals(const Faces& faces, Sets& sets) {
  const std::size_t corners = faces.angles.size();
  std::vector<glm::dvec3> sums(corners, glm::dvec3(0.0));
  std::vector<double> weights(corners, 0.0);
  for (std::size_t corner = 0; corner < corners; ++corner) {
    const std::size_t set = sets.find(corner);
    sums[set] += faces.angles[corner] * faces.normals[corner / 3];
    if (faces.normals[corner / 3] != glm::dvec3(0.0)) weights[set] += faces.angles[corner];
  }
  std::vector<CornerNormal> out(corners);
  for (std::size_t corner = 0; corner < corners; ++corner) {
    const std::size_t set = sets.find(corner);
    // Normals that cancel out say nothing: such a corner takes that of its own triangle.
    const bool cancelled = glm::length(sums[set]) <= 1e-6 * weights[set];
    out[corner] = cancelled ? CornerNormal{faces.normals[corner / 3], corners + corner}
                            : CornerNormal{sums[set], set};
  }
  return out;
}

/// Gives corners vertices: the first set of corners at a vertex keeps it, each other one gets a
/// copy.
class VertexCopies {
 public:
  explicit VertexCopies(Mesh& mesh) : mesh_(mesh), first_set_(mesh.vertex_count(), kUnused) {}

  std::uint32_t vertex_of(std::size_t corner, std::size_t set) {
    const std::uint32_t vertex = mesh_.triangles[corner];
    if (first_set_[vertex] == kUnused) first_set_[vertex] = set;
    if (first_set_[vertex] == set) return vertex;
    const auto [copy, added] =
        copies_.emplace(std::pair(vertex, set), static_cast<std::uint32_t>(mesh_.vertex_count()));
    if (added) append(vertex);
    return mesh_.triangles[corner] = copy->second;
  }

 private:
  static constexpr std::size_t kUnused = SIZE_MAX;

  void append(std::size_t vertex) {
    for (std::size_t c = 0; c < 3; ++c) {
      mesh_.positions.push_back(mesh_.positions[3 * vertex + c]);
      mesh_.normals.push_back(0.0f);
    }
    for (std::size_t c = 0; !mesh_.uvs.empty() && c < 2; ++c)
      mesh_.uvs.push_back(mesh_.uvs[2 * vertex + c]);
  }

  Mesh& mesh_;
  std::vector<std::size_t> first_set_;
  std::map<std::pair<std::uint32_t, std::size_t>, std::uint32_t> copies_;
};

}  // namespace

void add_smooth_normals(Mesh& mesh, double crease_degrees, const glm::dmat3& placement) {
  const Faces faces = measure(mesh, placement);
  Sets sets = sets_of_corners(mesh, faces, crease_degrees);
  const std::vector<CornerNormal> normals = corner_normals(faces, sets);
  mesh.normals.assign(mesh.positions.size(), 0.0f);
  for (std::size_t i = 2; i < mesh.normals.size(); i += 3) mesh.normals[i] = 1.0f;
  // A normal is placed by the inverse transpose, so the transpose takes it back.
  const glm::dmat3 back = glm::transpose(placement);
  VertexCopies copies(mesh);
  for (std::size_t corner = 0; corner < normals.size(); ++corner) {
    const glm::dvec3 placed = back * normals[corner].normal;
    const double length = glm::length(placed);
    const glm::dvec3 normal = length > 0.0 ? placed / length : glm::dvec3(0.0, 0.0, 1.0);
    const std::size_t vertex = copies.vertex_of(corner, normals[corner].set);
    for (int c = 0; c < 3; ++c)
      mesh.normals[3 * vertex + static_cast<std::size_t>(c)] = static_cast<float>(normal[c]);
  }
}

}  // namespace raysplats
