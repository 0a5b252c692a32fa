// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <glm/mat4x4.hpp>

#include "io/gltf/gltf_model.hpp"

namespace raysplats::io {

/// Calls place(mesh, matrix from the mesh to the world) for every node with a mesh of the default
/// scene (of the first one without a default, of all roots without scenes), or for every mesh of
/// files without nodes. The mesh exists. Throws DataError for nodes that are no forest and for
/// broken transforms.
void for_each_placed_mesh(const GltfReader& reader,
                          const std::function<void(int mesh, const glm::dmat4& matrix)>& place);

}  // namespace raysplats::io
