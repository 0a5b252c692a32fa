// SPDX-License-Identifier: Apache-2.0
#include "run/mirror_meshes.hpp"

#include <spdlog/spdlog.h>

#include <utility>

#include "io/mesh/mesh_file.hpp"

namespace raysplats {

Mirrors load_mirrors(const std::vector<std::string>& paths,
                     int max_bounces,
                     const std::array<double, 3>& origin) {
  Mirrors out;
  out.max_bounces = max_bounces;
  for (const std::string& path : paths) {
    io::MeshFile file = io::read_mesh(path);
    const auto first = static_cast<std::uint32_t>(out.materials.size());
    for (std::uint32_t& material : file.mesh.materials) material += first;
    for (Material& material : file.materials) {
      if (material.kind != Material::Kind::kMirror) material.color = {1.0f, 1.0f, 1.0f};
      material.kind = Material::Kind::kMirror;
      out.materials.push_back(material);
    }
    for (std::size_t i = 0; i < file.mesh.positions.size(); ++i) {
      float& position = file.mesh.positions[i];
      position = static_cast<float>(static_cast<double>(position) - origin[i % 3]);
    }
    out.meshes.push_back(std::move(file.mesh));
  }
  return out;
}

Mirrors mirrors_of(const ModelSource& source) {
  if (!source.trained || source.trained->mirrors.empty()) return {};
  spdlog::info("{} was trained with mirrors: its rays are traced one by one", source.file.string());
  return load_mirrors(source.trained->mirrors, source.trained->mirror_bounces, source.origin);
}

}  // namespace raysplats
