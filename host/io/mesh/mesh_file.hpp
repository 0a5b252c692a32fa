// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <functional>
#include <string>
#include <vector>

#include "raysplats/image.hpp"
#include "raysplats/scene.hpp"

namespace raysplats::io {

/// A mesh with the materials and textures that it uses; those that no triangle uses are left out.
struct MeshFile {
  Mesh mesh;                        ///< has triangles and passes validate()
  std::vector<Material> materials;  ///< at least one; `texture` indexes `textures`
  std::vector<Image> textures;      ///< 3 channels
  std::vector<bool> bare;           ///< per triangle: a corner has no texture coordinates
};

/// Whether a material of a mesh file, by its name, will be seen; an empty one says so of all.
using SeenMaterials = std::function<bool(const std::string& name)>;

/// Reads a triangle mesh by its extension: .obj (Wavefront, with its .mtl files), .ply, .gltf or
/// .glb (glTF 2.0). docs/meshes.md says what of each format is read and how materials map. Normals
/// are those of the file, unit vectors, or none. Of materials that are not `seen` only the name is
/// of use: their pictures are not looked for. Throws DataError with the file's name for anything
/// missing, malformed, truncated or oversized; a missing .mtl file is only logged.
MeshFile read_mesh(const std::filesystem::path& path, const SeenMaterials& seen = {});

enum class MeshFormat { kObj, kPly, kGltf };

/// Most vertices, and most triangles, of a mesh that stands alone.
constexpr std::size_t kMostAlone = std::size_t{1} << 21;

/// A mesh from memory that may be anyone's: whatever it names, no other file is opened, and no
/// picture is decoded; it has one material. `name` is that of messages. Throws DataError as
/// read_mesh(), also for buffers in other files and for more than kMostAlone.
Mesh read_mesh_alone(MeshFormat format, std::vector<std::byte> bytes, const std::string& name);

/// The bytes of a mesh file.
struct MeshBytes {
  std::filesystem::path path;  ///< that messages name; beside it is what the file names
  std::vector<std::byte> bytes;
  bool alone = false;  ///< as read_mesh_alone()
  SeenMaterials seen = {};
};

/// read_mesh() of one format whatever the extension, without the final validate().
MeshFile read_obj(MeshBytes file);
MeshFile read_ply_mesh(MeshBytes file);
MeshFile read_gltf(MeshBytes file);

/// A texture has 3 channels: grey is repeated, an alpha channel left out.
Image to_texture(const Image& image);

}  // namespace raysplats::io
