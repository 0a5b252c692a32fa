// SPDX-License-Identifier: Apache-2.0
#include "io/mesh/mesh_file.hpp"

#include <fmt/format.h>

#include <string>

#include "io/byte_reader.hpp"
#include "raysplats/error.hpp"
#include "scene/mesh/mesh.hpp"
#include "util/path_text.hpp"

namespace raysplats::io {
namespace {

MeshFile read_format(MeshFormat format, MeshBytes bytes) {
  const std::string name = bytes.path.string();
  MeshFile file;
  switch (format) {
    case MeshFormat::kObj:
      file = read_obj(std::move(bytes));
      break;
    case MeshFormat::kPly:
      file = read_ply_mesh(std::move(bytes));
      break;
    case MeshFormat::kGltf:
      file = read_gltf(std::move(bytes));
      break;
  }
  if (file.mesh.triangles.empty())
    throw DataError(fmt::format("The mesh {} has no triangles", name));
  validate(file.mesh, file.materials.size(), name);
  normalize_normals(file.mesh);
  return file;
}

}  // namespace

MeshFile read_mesh(const std::filesystem::path& path, const SeenMaterials& seen) {
  const std::string extension = lower_extension(path);
  MeshFormat format = MeshFormat::kGltf;
  if (extension == ".obj") {
    format = MeshFormat::kObj;
  } else if (extension == ".ply") {
    format = MeshFormat::kPly;
  } else if (extension != ".gltf" && extension != ".glb") {
    throw DataError(
        fmt::format("The mesh {} has an unknown extension: it must be .obj, .ply, .gltf or .glb",
                    path.string()));
  }
  return read_format(format, {path, read_file(path), false, seen});
}

Mesh read_mesh_alone(MeshFormat format, std::vector<std::byte> bytes, const std::string& name) {
  Mesh mesh = read_format(format, {name, std::move(bytes), true}).mesh;
  mesh.materials.assign(mesh.triangle_count(), 0);
  return mesh;
}

Image to_texture(const Image& image) {
  if (image.channels == 3) return image;
  Image texture(image.width, image.height, 3);
  for (std::size_t pixel = 0; pixel < image.pixels(); ++pixel) {
    const float* from = &image.data[pixel * static_cast<std::size_t>(image.channels)];
    for (std::size_t c = 0; c < 3; ++c) {
      texture.data[3 * pixel + c] = image.channels > 3 ? from[c] : from[0];
    }
  }
  return texture;
}

}  // namespace raysplats::io
