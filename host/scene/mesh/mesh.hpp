// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <string>

#include "raysplats/scene.hpp"

namespace raysplats {

/// Checks what every user of a mesh relies on: array sizes that fit each other, indices in range,
/// finite positions, normals and texture coordinates. Degenerate triangles pass (no ray hits them).
/// Throws DataError that names `name` and the first bad vertex or triangle (counted from 0).
/// O(V+T).
void validate(const Mesh& mesh, std::size_t material_count, const std::string& name);

/// The mesh under an affine map. Normals go with the inverse transpose; a map that mirrors also
/// swaps two corners of every triangle, so that outward stays outward. Throws DataError for a
/// matrix that is not finite or not affine (last row 0 0 0 1). O(V+T).
Mesh transformed(const Mesh& mesh, const glm::dmat4& matrix);

/// Gives a mesh smooth normals in place of those it has: per vertex the mean of the normals of its
/// triangles, weighted by their angles there (Thuermer and Wuethrich 1998). Triangles share a
/// normal at a vertex when they are connected around it by edges that bend by at most
/// `crease_degrees`; vertices at equal positions count as one, so seams of texture coordinates do
/// not show. Vertices on harder edges are split, the others keep their index. Angles and means are
/// those of the mesh under `placement`, an invertible map that it will be put through later. The
/// mesh must have passed validate(). O(T log T).
void add_smooth_normals(Mesh& mesh,
                        double crease_degrees = 180.0,
                        const glm::dmat3& placement = glm::dmat3(1.0));

/// Gives every vertex whose normal has no direction (zero length) the area-weighted mean normal of
/// its triangles and makes the others unit vectors. Nothing happens without normals. O(V+T).
void normalize_normals(Mesh& mesh);

}  // namespace raysplats
