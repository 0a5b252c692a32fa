// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "raysplats/image.hpp"
#include "raysplats/scene.hpp"

namespace raysplats::io {

/// A mesh with the materials and textures that it uses; those that no triangle uses are left out.
struct MeshFile {
  Mesh mesh;                        ///< has triangles and passes validate()
  std::vector<Material> materials;  ///< at least one; `texture` indexes `textures`
  std::vector<Image> textures;      ///< 3 channels
};

/// Reads a triangle mesh by its extension: .obj (Wavefront, with its .mtl files), .ply, .gltf or
/// .glb (glTF 2.0). docs/meshes.md says what of each format is read and how materials map. Normals
/// are those of the file, unit vectors, or none. Throws DataError with the file's name for anything
/// missing, malformed, truncated or oversized; a missing .mtl file is only logged.
MeshFile read_mesh(const std::filesystem::path& path);

/// read_mesh() of one format whatever the extension, without the final validate().
MeshFile read_obj(const std::filesystem::path& path);
MeshFile read_ply_mesh(const std::filesystem::path& path);
MeshFile read_gltf(const std::filesystem::path& path);

/// A texture has 3 channels: grey is repeated, an alpha channel left out.
Image to_texture(const Image& image);

}  // namespace raysplats::io
