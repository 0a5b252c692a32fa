// SPDX-License-Identifier: Apache-2.0
#include "scene/mesh/mesh.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <utility>
#include <vector>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

glm::dvec3 vector_at(const std::vector<float>& values, std::size_t i) {
  return {static_cast<double>(values[3 * i]), static_cast<double>(values[3 * i + 1]),
          static_cast<double>(values[3 * i + 2])};
}

void store(std::vector<float>& values, std::size_t i, const glm::dvec3& v) {
  for (int c = 0; c < 3; ++c) {
    values[3 * i + static_cast<std::size_t>(c)] = static_cast<float>(v[c]);
  }
}

/// The first index of a value that is not finite, or the size.
std::size_t first_not_finite(const std::vector<float>& values) {
  const auto bad =
      std::find_if(values.begin(), values.end(), [](float v) { return !std::isfinite(v); });
  return static_cast<std::size_t>(bad - values.begin());
}

/// Twice the area times the normal; for any matrix A and its cofactors C, cross(Au, Av) =
/// C cross(u, v).
glm::dvec3 area_normal(const Mesh& mesh, std::size_t triangle) {
  const glm::dvec3 a = vector_at(mesh.positions, mesh.triangles[3 * triangle]);
  const glm::dvec3 b = vector_at(mesh.positions, mesh.triangles[3 * triangle + 1]);
  const glm::dvec3 c = vector_at(mesh.positions, mesh.triangles[3 * triangle + 2]);
  return glm::cross(b - a, c - a);
}

}  // namespace

void validate(const Mesh& mesh, std::size_t material_count, const std::string& name) {
  if (mesh.positions.size() % 3 != 0 || mesh.triangles.size() % 3 != 0) {
    throw DataError(
        fmt::format("The mesh {} is malformed: {} coordinates and {} corners are no whole number "
                    "of vertices and triangles",
                    name, mesh.positions.size(), mesh.triangles.size()));
  }
  const std::size_t vertices = mesh.vertex_count();
  const std::size_t triangles = mesh.triangle_count();
  const auto check_size = [&](const char* what, std::size_t size, std::size_t expected) {
    if (size == expected) return;
    throw DataError(fmt::format("The mesh {} is malformed: it has {} {} where {} are needed", name,
                                size, what, expected));
  };
  if (!mesh.normals.empty()) check_size("normal coordinates", mesh.normals.size(), 3 * vertices);
  if (!mesh.uvs.empty()) check_size("texture coordinates", mesh.uvs.size(), 2 * vertices);
  check_size("material indices", mesh.materials.size(), triangles);
  const auto check_finite = [&](const char* what, const std::vector<float>& values,
                                std::size_t per_vertex) {
    const std::size_t bad = first_not_finite(values);
    if (bad == values.size()) return;
    throw DataError(fmt::format("The mesh {} is malformed: {} of vertex {} is {}, not finite", name,
                                what, bad / per_vertex, values[bad]));
  };
  check_finite("the position", mesh.positions, 3);
  check_finite("the normal", mesh.normals, 3);
  check_finite("the texture coordinate", mesh.uvs, 2);
  for (std::size_t i = 0; i < mesh.triangles.size(); ++i) {
    if (mesh.triangles[i] < vertices) continue;
    throw DataError(
        fmt::format("The mesh {} is malformed: triangle {} has the vertex {}, but there are {}",
                    name, i / 3, mesh.triangles[i], vertices));
  }
  for (std::size_t i = 0; i < triangles; ++i) {
    if (mesh.materials[i] < material_count) continue;
    throw DataError(
        fmt::format("The mesh {} is malformed: triangle {} has the material {}, but there are {}",
                    name, i, mesh.materials[i], material_count));
  }
}

Mesh transformed(const Mesh& mesh, const glm::dmat4& matrix) {
  for (int column = 0; column < 4; ++column) {
    for (int row = 0; row < 4; ++row) {
      const double expected = column == 3 ? 1.0 : 0.0;
      if (std::isfinite(matrix[column][row]) && (row < 3 || matrix[column][row] == expected)) {
        continue;
      }
      throw DataError(
          fmt::format("A mesh cannot be transformed by a matrix whose row {} has the value {} in "
                      "column {}: it must be finite with the last row 0 0 0 1",
                      row, matrix[column][row], column));
    }
  }
  const glm::dmat3 linear(matrix);
  const glm::dvec3 offset(matrix[3]);
  // The inverse transpose up to a positive factor, also where the matrix has no inverse.
  glm::dmat3 cofactors(glm::cross(linear[1], linear[2]), glm::cross(linear[2], linear[0]),
                       glm::cross(linear[0], linear[1]));
  const bool mirrors = glm::dot(linear[0], cofactors[0]) < 0.0;
  if (mirrors) cofactors = -cofactors;
  Mesh result = mesh;
  for (std::size_t i = 0; i < mesh.vertex_count(); ++i) {
    store(result.positions, i, linear * vector_at(mesh.positions, i) + offset);
  }
  for (std::size_t i = 0; i < mesh.normals.size() / 3; ++i) {
    const glm::dvec3 normal = cofactors * vector_at(mesh.normals, i);
    const double length = glm::length(normal);
    if (length > 0.0) store(result.normals, i, normal / length);
  }
  if (mirrors) {
    for (std::size_t i = 0; i < result.triangle_count(); ++i) {
      std::swap(result.triangles[3 * i + 1], result.triangles[3 * i + 2]);
    }
  }
  return result;
}

void normalize_normals(Mesh& mesh) {
  if (mesh.normals.empty()) return;
  std::vector<bool> missing(mesh.vertex_count());
  bool any_missing = false;
  for (std::size_t i = 0; i < mesh.vertex_count(); ++i) {
    const glm::dvec3 normal = vector_at(mesh.normals, i);
    const double length = glm::length(normal);
    missing[i] = length == 0.0;
    any_missing = any_missing || missing[i];
    if (!missing[i]) store(mesh.normals, i, normal / length);
  }
  if (!any_missing) return;
  std::vector<glm::dvec3> sums(mesh.vertex_count(), glm::dvec3(0.0));
  for (std::size_t i = 0; i < mesh.triangle_count(); ++i) {
    const glm::dvec3 normal = area_normal(mesh, i);
    for (std::size_t k = 0; k < 3; ++k) sums[mesh.triangles[3 * i + k]] += normal;
  }
  for (std::size_t i = 0; i < mesh.vertex_count(); ++i) {
    if (!missing[i]) continue;
    const double length = glm::length(sums[i]);
    // Triangles without area are never hit, so that any unit vector will do.
    store(mesh.normals, i, length > 0.0 ? sums[i] / length : glm::dvec3(0.0, 0.0, 1.0));
  }
}

}  // namespace raysplats
