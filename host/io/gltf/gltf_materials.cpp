// SPDX-License-Identifier: Apache-2.0
#include "io/gltf/gltf_materials.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "io/image/image_file.hpp"
#include "raysplats/error.hpp"
#include "scene/mesh/mesh_edges.hpp"
#include "util/srgb.hpp"

namespace raysplats::io {
namespace {

/// A number of an extension's object.
double number(const tinygltf::Value& object, const std::string& key, double fallback) {
  if (!object.Has(key)) return fallback;
  const tinygltf::Value& value = object.Get(key);
  const double found = value.IsNumber() ? value.GetNumberAsDouble() : fallback;
  return std::isfinite(found) ? found : fallback;
}

double number(const tinygltf::ExtensionMap& extensions,
              const std::string& extension,
              const std::string& key,
              double fallback) {
  const auto found = extensions.find(extension);
  return found == extensions.end() ? fallback : number(found->second, key, fallback);
}

template <std::size_t N>
void numbers(const tinygltf::Value& object, const std::string& key, double (&values)[N]) {
  if (!object.Has(key)) return;
  const tinygltf::Value& list = object.Get(key);
  for (std::size_t i = 0; i < N && i < list.ArrayLen(); ++i) {
    const tinygltf::Value& value = list.Get(static_cast<int>(i));
    if (value.IsNumber() && std::isfinite(value.GetNumberAsDouble())) {
      values[i] = value.GetNumberAsDouble();
    }
  }
}

/// An index of an extension's object; -1 for none.
int index_of(const tinygltf::Value& object, const std::string& key, int fallback) {
  return static_cast<int>(std::clamp(number(object, key, fallback), -1.0, 1e6));
}

const tinygltf::Value* specular_glossiness_of(const tinygltf::Material& material) {
  const auto found = material.extensions.find("KHR_materials_pbrSpecularGlossiness");
  return found == material.extensions.end() ? nullptr : &found->second;
}

/// A texture of an extension's object, which tinygltf leaves as it is.
tinygltf::TextureInfo texture_of(const tinygltf::Value& object, const std::string& key) {
  tinygltf::TextureInfo info;
  if (!object.Has(key)) return info;
  const tinygltf::Value& texture = object.Get(key);
  info.index = index_of(texture, "index", -1);
  info.texCoord = index_of(texture, "texCoord", 0);
  if (texture.Has("extensions") && texture.Get("extensions").IsObject()) {
    info.extensions = texture.Get("extensions").Get<tinygltf::Value::Object>();
  }
  return info;
}

double unit(double value) { return std::clamp(value, 0.0, 1.0); }

/// A display value from linear light; the curve goes on above 1.
float encoded(double linear) {
  return static_cast<float>(std::min(std::max(display_from_light(linear), 0.0), 1e6));
}

constexpr double kUsualIndex = 1.5;

double index_of_refraction(const tinygltf::Material& material) {
  return std::clamp(number(material.extensions, "KHR_materials_ior", "ior", kUsualIndex), 1.0,
                    100.0);
}

/// Straight on, of a dielectric of this index.
double reflectance_of(double ior) { return std::pow((ior - 1.0) / (ior + 1.0), 2.0); }

/// Strength of the lobe max(0, <n,h>)^k that stands for a dielectric: its reflectance straight on
/// times (k + 8) / 8, the lobe's normalization (Akenine-Moeller et al. 2008, Real-Time
/// Rendering, 3rd edition, section 7.5.7) in units in which a diffuse surface shows its colour.
float specular_strength(double roughness, double reflectance) {
  const double width = std::pow(std::max(roughness, 0.02), 4.0);
  const double exponent = std::clamp(2.0 / width - 2.0, 1.0, 1e4);
  return static_cast<float>(std::min(1.0, reflectance * (exponent + 8.0) / 8.0));
}

/// Per unit of length from the colour that is left of white after a distance (Beer's law).
Rgb absorption(const tinygltf::ExtensionMap& extensions) {
  const auto found = extensions.find("KHR_materials_volume");
  Rgb result{0, 0, 0};
  if (found == extensions.end()) return result;
  const double distance = number(found->second, "attenuationDistance", 0.0);
  double color[3] = {1, 1, 1};
  numbers(found->second, "attenuationColor", color);
  if (!(distance > 0.0)) return result;
  for (std::size_t c = 0; c < 3; ++c) {
    const double left = std::clamp(static_cast<double>(encoded(color[c])), 1e-4, 1.0);
    result[c] = static_cast<float>(std::min(-std::log(left) / distance, 1e30));
  }
  return result;
}

/// Whether alpha lets anything through.
bool is_cut_out(const Image& image) {
  const auto channels = static_cast<std::size_t>(image.channels);
  if (channels % 2 != 0) return false;
  for (std::size_t i = channels - 1; i < image.data.size(); i += channels) {
    if (image.data[i] < 1.0f) return true;
  }
  return false;
}

}  // namespace

const tinygltf::Material& GltfMaterials::source(int material) const {
  const auto& all = reader_.model().materials;
  if (material < 0 || static_cast<std::size_t>(material) >= all.size()) {
    reader_.fail(fmt::format("there is no material {}", material));
  }
  return all[static_cast<std::size_t>(material)];
}

std::uint32_t GltfMaterials::index(int material) {
  const auto [entry, added] = used_.emplace(material, static_cast<std::uint32_t>(materials.size()));
  if (!added) return entry->second;
  if (material == -1) {
    materials.emplace_back().name = "default";
  } else {
    const tinygltf::Material& from = source(material);
    materials.push_back(map_material(from, material));
    const bool thick =
        number(from.extensions, "KHR_materials_volume", "thicknessFactor", 0.0) > 0.0;
    if (materials.back().kind == Material::Kind::kGlass && !thick) thin_.push_back(entry->second);
  }
  return entry->second;
}

void GltfMaterials::make_thin_glass(const Mesh& mesh) {
  if (thin_.empty()) return;
  const std::map<std::uint32_t, std::size_t> open = open_edges(mesh);
  for (const std::uint32_t index : thin_) {
    if (!open.contains(index)) continue;
    materials[index].ior = 1.0f;
    materials[index].absorption = {0, 0, 0};
  }
}

GltfTextureUse GltfMaterials::texture_use(int material) const {
  GltfTextureUse use;
  if (material == -1) return use;
  const tinygltf::Material& from = source(material);
  const tinygltf::Value* specular = specular_glossiness_of(from);
  const tinygltf::TextureInfo info = specular != nullptr
                                         ? texture_of(*specular, "diffuseTexture")
                                         : from.pbrMetallicRoughness.baseColorTexture;
  if (info.index < 0) return use;
  int set = info.texCoord;
  const auto extension = info.extensions.find("KHR_texture_transform");
  if (extension != info.extensions.end()) {
    numbers(extension->second, "offset", use.offset);
    numbers(extension->second, "scale", use.scale);
    use.rotation = number(extension->second, "rotation", 0.0);
    set = index_of(extension->second, "texCoord", set);
  }
  use.attribute = fmt::format("TEXCOORD_{}", set);
  const tinygltf::Model& model = reader_.model();
  const auto texture = static_cast<std::size_t>(info.index);
  const int sampler = texture < model.textures.size() ? model.textures[texture].sampler : -1;
  if (sampler >= 0 && static_cast<std::size_t>(sampler) < model.samplers.size()) {
    const tinygltf::Sampler& from = model.samplers[static_cast<std::size_t>(sampler)];
    use.repeats[0] = from.wrapS == TINYGLTF_TEXTURE_WRAP_REPEAT;
    use.repeats[1] = from.wrapT == TINYGLTF_TEXTURE_WRAP_REPEAT;
  }
  return use;
}

Image GltfMaterials::decode(int texture) const {
  const auto& all = reader_.model().textures;
  if (texture < 0 || static_cast<std::size_t>(texture) >= all.size()) {
    reader_.fail(fmt::format("there is no texture {}", texture));
  }
  const int image = all[static_cast<std::size_t>(texture)].source;
  const std::span<const std::byte> bytes = reader_.image(image);
  const std::string& uri = reader_.model().images[static_cast<std::size_t>(image)].uri;
  return decode_image(bytes, uri.empty() ? fmt::format("{} of {}", image, reader_.path().string())
                                         : (reader_.path().parent_path() / uri).string());
}

int GltfMaterials::texture(int texture) {
  if (texture < 0) return -1;
  const auto [entry, added] = loaded_.emplace(texture, static_cast<int>(textures.size()));
  if (added) {
    const Image image = decode(texture);
    if (is_cut_out(image)) cut_out_.insert(texture);
    textures.push_back(to_texture(image));
  }
  return entry->second;
}

double GltfMaterials::mean(int texture, std::size_t channel) {
  if (texture < 0) return 1.0;
  const auto [entry, added] = means_.emplace(texture, std::array<double, 4>{0, 0, 0, 1});
  if (added) {
    const Image image = decode(texture);
    const auto channels = static_cast<std::size_t>(image.channels);
    const std::size_t colors = channels < 3 ? 1 : 3;
    const auto mean_of = [&](std::size_t from) {
      double sum = 0.0;
      for (std::size_t i = from; i < image.data.size(); i += channels) {
        sum += static_cast<double>(image.data[i]);
      }
      return sum / static_cast<double>(image.pixels());
    };
    for (std::size_t c = 0; c < 3; ++c) entry->second[c] = mean_of(c % colors);
    if (channels > colors) entry->second[3] = mean_of(colors);
  }
  return entry->second[channel];
}

GltfMaterials::Surface GltfMaterials::metallic_roughness(const tinygltf::Material& from) {
  const tinygltf::PbrMetallicRoughness& pbr = from.pbrMetallicRoughness;
  const std::vector<double>& color = pbr.baseColorFactor;
  const int rough_texture = pbr.metallicRoughnessTexture.index;
  return {{unit(color[0]), unit(color[1]), unit(color[2])},
          unit(color[3]),
          pbr.baseColorTexture.index,
          unit(pbr.metallicFactor) * mean(rough_texture, 2),
          unit(pbr.roughnessFactor) * mean(rough_texture, 1),
          reflectance_of(index_of_refraction(from))};
}

GltfMaterials::Surface GltfMaterials::specular_glossiness(const tinygltf::Value& from) {
  double diffuse[4] = {1, 1, 1, 1};
  double specular[3] = {1, 1, 1};
  numbers(from, "diffuseFactor", diffuse);
  numbers(from, "specularFactor", specular);
  const int mixed_texture = texture_of(from, "specularGlossinessTexture").index;
  double strongest = 0.0;
  for (std::size_t c = 0; c < 3; ++c) {
    specular[c] = unit(specular[c]) * light_from_display(mean(mixed_texture, c));
    strongest = std::max(strongest, specular[c]);
  }
  const bool metal = strongest >= 0.5;
  Surface surface;
  for (std::size_t c = 0; c < 3; ++c) {
    surface.color[c] = metal ? specular[c] : unit(diffuse[c]) * (1.0 - strongest);
  }
  surface.alpha = unit(diffuse[3]);
  surface.texture = metal ? -1 : texture_of(from, "diffuseTexture").index;
  surface.metallic = metal ? 1.0 : 0.0;
  surface.roughness = 1.0 - unit(number(from, "glossinessFactor", 1.0)) * mean(mixed_texture, 3);
  surface.reflectance = metal ? reflectance_of(kUsualIndex) : strongest;
  return surface;
}

Material GltfMaterials::map_material(const tinygltf::Material& from, int number_in_file) {
  Material material;
  material.name = from.name.empty() ? fmt::format("material {}", number_in_file) : from.name;
  if (seen_ && !seen_(material.name)) return material;
  const tinygltf::Value* specular = specular_glossiness_of(from);
  const Surface surface =
      specular != nullptr ? specular_glossiness(*specular) : metallic_roughness(from);
  for (std::size_t c = 0; c < 3; ++c) material.color[c] = encoded(surface.color[c]);
  if (from.alphaMode == "MASK" && surface.alpha < from.alphaCutoff) {
    material.kind = Material::Kind::kTransparent;
    material.opacity = 0.0f;
    return material;
  }
  material.texture = texture(surface.texture);
  if (from.alphaMode != "OPAQUE" && cut_out_.contains(surface.texture) && !warned_of_alpha_) {
    warned_of_alpha_ = true;
    spdlog::warn(
        "{}: the alpha of the texture of the material '{}' is left out: its triangles are seen "
        "whole",
        reader_.path().string(), material.name);
  }
  const double alpha = from.alphaMode == "BLEND" ? surface.alpha : 1.0;
  const double strength = std::max(
      number(from.extensions, "KHR_materials_emissive_strength", "emissiveStrength", 1.0), 0.0);
  for (std::size_t c = 0; c < 3; ++c) {
    // The texture's mean is a display value already.
    material.emission[c] = encoded(std::max(from.emissiveFactor[c], 0.0) * strength) *
                           static_cast<float>(mean(from.emissiveTexture.index, c));
  }
  const Rgb black{0, 0, 0};
  if (number(from.extensions, "KHR_materials_transmission", "transmissionFactor", 0.0) >= 0.5) {
    material.kind = Material::Kind::kGlass;
    material.ior = static_cast<float>(index_of_refraction(from));
    material.absorption = absorption(from.extensions);
    return material;
  }
  material.roughness = static_cast<float>(surface.roughness);
  if (alpha == 1.0 && surface.metallic >= 0.5 && surface.roughness <= 0.5) {
    material.kind = Material::Kind::kMirror;
    return material;
  }
  if (alpha < 1.0) {
    material.kind = Material::Kind::kTransparent;
    material.opacity = static_cast<float>(alpha);
  } else if (material.emission != black && material.color == black) {
    material.kind = Material::Kind::kEmissive;
    return material;
  }
  material.specular = specular_strength(surface.roughness, surface.reflectance);
  return material;
}

}  // namespace raysplats::io
