// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "io/mesh/mesh_file.hpp"
#include "raysplats/image.hpp"
#include "raysplats/scene.hpp"

namespace raysplats::io {

/// The materials of an OBJ file's .mtl files, mapped when a face first uses them:
///
/// | MTL | Material |
/// | --- | --- |
/// | Kd, map_Kd | colour (without Kd white under a texture, black where Ke is), texture |
/// | Ks, Ns (unless illum 1) | strength (mean) and width of the specular lobe |
/// | illum 3, 5 | mirror of colour Ks (Kd where Ks is 0) |
/// | illum 4, 6, 7, 9, or Ni > 1 with d < 1 or Tf not 1 | glass of index Ni and colour Tf |
/// | d < 1 otherwise | transparent of opacity d |
/// | Ke | emission; emissive where Kd is 0 too |
class MtlMaterials {
 public:
  /// `obj` is the path of the OBJ file; names of .mtl files are relative to its folder. Textures
  /// are read of materials that are `seen`.
  explicit MtlMaterials(std::filesystem::path obj, SeenMaterials seen = {})
      : obj_(std::move(obj)), seen_(std::move(seen)) {}

  /// Reads the file of an mtllib line: one name, or several that are separated by blanks. A file
  /// that is missing is logged. Throws DataError when one cannot be read.
  void add_library(std::string_view names);
  /// Index in materials() of a material by the name that follows usemtl. An unknown name is logged
  /// and gives the default material of that name; the first map_d, which nothing is made of, is
  /// logged too. Throws DataError for a texture that is missing or broken.
  std::uint32_t index(std::string_view name);

  /// Maps all materials of the files, in the order of their names. Throws as index().
  void use_all();

  std::vector<Material> materials;
  std::vector<Image> textures;

 private:
  void read_library(const std::filesystem::path& path);
  int texture(const std::filesystem::path& path, const std::string& material);
  std::filesystem::path obj_;
  SeenMaterials seen_;
  std::map<std::string, Material, std::less<>> known_;  ///< mapped, without textures
  std::map<std::string, std::filesystem::path, std::less<>> texture_paths_;  ///< by material
  std::set<std::string, std::less<>> cut_out_;  ///< materials with a map_d
  std::map<std::string, std::uint32_t, std::less<>> used_;
  std::map<std::filesystem::path, int> loaded_;
  bool warned_of_cut_out_ = false;
};

}  // namespace raysplats::io
