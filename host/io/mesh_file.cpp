// SPDX-License-Identifier: Apache-2.0
#include "io/mesh_file.hpp"

#include <fmt/format.h>

#include <string>

#include "core/mesh.hpp"
#include "raysplats/error.hpp"

namespace raysplats::io {

MeshFile read_mesh(const std::filesystem::path& path) {
  std::string extension = path.extension().string();
  for (char& c : extension) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  MeshFile file;
  if (extension == ".obj") {
    file = read_obj(path);
  } else if (extension == ".ply") {
    file = read_ply_mesh(path);
  } else if (extension == ".gltf" || extension == ".glb") {
    file = read_gltf(path);
  } else {
    throw DataError(
        fmt::format("The mesh {} has an unknown extension: it must be .obj, .ply, .gltf or .glb",
                    path.string()));
  }
  if (file.mesh.triangles.empty()) {
    throw DataError(fmt::format("The mesh {} has no triangles", path.string()));
  }
  validate(file.mesh, file.materials.size(), path.string());
  normalize_normals(file.mesh);
  return file;
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
