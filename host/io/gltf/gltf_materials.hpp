// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "io/gltf/gltf_model.hpp"
#include "io/mesh/mesh_file.hpp"
#include "raysplats/image.hpp"
#include "raysplats/scene.hpp"

namespace raysplats::io {

/// How the base colour texture of a glTF material, or another in its place, is laid on a primitive.
struct GltfTextureUse {
  std::string attribute = "TEXCOORD_0";
  /// uv' = offset + R(rotation) scale uv (KHR_texture_transform)
  double offset[2] = {0, 0};
  double scale[2] = {1, 1};
  double rotation = 0;
  bool repeats[2] = {true, true};  ///< beyond its borders, along u and v
};

/// The materials of a glTF file, mapped when a primitive first uses them; the first row that
/// applies decides:
///
/// | glTF | Material |
/// | --- | --- |
/// | alphaMode MASK, alpha < alphaCutoff | transparent of opacity 0 |
/// | KHR_materials_transmission >= 0.5 | glass; KHR_materials_ior, attenuation as absorption |
/// | alphaMode BLEND, alpha < 1 | transparent of opacity alpha |
/// | metallic >= 0.5 and roughness <= 0.5 | mirror of that roughness |
/// | emissive factor > 0, base colour black | emissive |
/// | else | diffuse with a specular lobe after the roughness and the index of refraction |
///
/// KHR_materials_pbrSpecularGlossiness counts in place of metallic and roughness: its glossiness is
/// 1 - roughness, and a specular colour F0 whose largest channel is 0.5 or more makes it a metal of
/// that colour, a smaller one leaves 1 - F0 of the diffuse colour.
///
/// The colour is the base colour factor, the texture its texture. glTF's factors are linear light,
/// whereas colours here are display values, so factors are encoded as sRGB (IEC 61966-2-1);
/// textures are encoded already. Textures of other properties count with their mean.
class GltfMaterials {
 public:
  /// Materials that are not `seen` have a name alone.
  explicit GltfMaterials(const GltfReader& reader, SeenMaterials seen = {})
      : reader_(reader), seen_(std::move(seen)) {}

  /// Index in `materials` of a material of the file; -1 is the default one. Throws DataError for
  /// references to what the file lacks and for textures that cannot be decoded.
  std::uint32_t index(int material);
  /// Of a material's base colour texture.
  GltfTextureUse texture_use(int material) const;
  /// Glass without a volume (KHR_materials_volume with a thickness) is a thin sheet, which light
  /// passes straight on: such is glass from here on that is open somewhere in the mesh. Exporters
  /// leave the volume out of solid bodies as well, which stay what they are.
  void make_thin_glass(const Mesh& mesh);

  std::vector<Material> materials;
  std::vector<Image> textures;

 private:
  const tinygltf::Material& source(int material) const;
  Material map_material(const tinygltf::Material& from, int number);
  Image decode(int texture) const;
  int texture(int texture);
  /// Mean of a channel of a texture, red, green, blue or alpha; 1 without one.
  double mean(int texture, std::size_t channel);
  /// What a material says of its surface, in linear light.
  struct Surface {
    double color[3];
    double alpha;
    int texture;  ///< of the colour; -1 for none
    double metallic;
    double roughness;
    double reflectance;  ///< straight on, of what is no metal
  };
  Surface metallic_roughness(const tinygltf::Material& from);
  Surface specular_glossiness(const tinygltf::Value& from);
  const GltfReader& reader_;
  SeenMaterials seen_;
  std::map<int, std::uint32_t> used_;
  std::map<int, int> loaded_;
  std::map<int, std::array<double, 4>> means_;
  std::set<int> cut_out_;            ///< textures that alpha makes see-through somewhere
  std::vector<std::uint32_t> thin_;  ///< glass without a volume
  bool warned_of_alpha_ = false;
};

}  // namespace raysplats::io
