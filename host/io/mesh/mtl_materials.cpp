// SPDX-License-Identifier: Apache-2.0
#include "io/mesh/mtl_materials.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>
#include <tiny_obj_loader.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <sstream>
#include <utility>

#include "io/byte_reader.hpp"
#include "io/mesh/texture_file.hpp"
#include "io/text_reader.hpp"
#include "raysplats/error.hpp"
#include "util/file_kind.hpp"

namespace raysplats::io {
namespace {

constexpr std::uint64_t kMaxLibraryBytes = std::uint64_t{64} << 20;

/// A number of an untrusted file, limited to a range; what is not finite becomes `fallback`.
float bounded(float value, float low, float high, float fallback) {
  return std::isfinite(value) ? std::clamp(value, low, high) : fallback;
}

Rgb color_of(const float (&values)[3], float high) {
  Rgb color;
  for (std::size_t c = 0; c < 3; ++c) color[c] = bounded(values[c], 0.0f, high, 0.0f);
  return color;
}

bool is_black(const Rgb& color) { return color == Rgb{0, 0, 0}; }

/// What tinyobjloader does not tell of a material.
struct Named {
  std::string name;
  bool has_color = false;  // by Kd
};

Material map_material(const tinyobj::material_t& mtl, const Named& named) {
  Material material;
  material.name = named.name;
  material.emission = color_of(mtl.emission, std::numeric_limits<float>::max());
  // Without Kd tinyobjloader's depends on the materials before.
  if (named.has_color) {
    material.color = color_of(mtl.diffuse, 1.0f);
  } else if (!mtl.diffuse_texname.empty()) {
    material.color = {1, 1, 1};
  } else if (!is_black(material.emission)) {
    material.color = {0, 0, 0};
  }
  const Rgb specular = color_of(mtl.specular, 1.0f);
  const Rgb filter = color_of(mtl.transmittance, 1.0f);
  const float dissolve = bounded(mtl.dissolve, 0.0f, 1.0f, 1.0f);
  const float ior = mtl.ior > 0.0f ? bounded(mtl.ior, 0.01f, 10.0f, 1.0f) : 1.0f;
  // tinyobjloader's 0 0 0 is a filter that the file lacks; 1 1 1, which exporters write for opaque
  // materials too, filters nothing.
  const bool filters = !is_black(filter) && filter != Rgb{1, 1, 1};
  const int illum = mtl.illum;
  if (illum == 3 || illum == 5) {
    material.kind = Material::Kind::kMirror;
    if (!is_black(specular)) material.color = specular;
    return material;
  }
  if (illum == 4 || illum == 6 || illum == 7 || illum == 9 ||
      (ior > 1.0f && (dissolve < 1.0f || filters))) {
    material.kind = Material::Kind::kGlass;
    material.ior = ior;
    material.color = filters ? filter : Rgb{1, 1, 1};
    return material;
  }
  if (illum != 1) {
    material.specular = (specular[0] + specular[1] + specular[2]) / 3.0f;
    // The width r whose exponent 2/r^4 - 2 is Ns.
    const float exponent = bounded(mtl.shininess, 0.0f, 1e4f, 0.0f);
    material.roughness = std::pow(2.0f / (exponent + 2.0f), 0.25f);
  }
  if (dissolve < 1.0f) {
    material.kind = Material::Kind::kTransparent;
    material.opacity = dissolve;
  } else if (!is_black(material.emission) && is_black(material.color)) {
    material.kind = Material::Kind::kEmissive;
  }
  return material;
}

std::string trimmed(std::string_view text) {
  constexpr std::string_view kBlanks = " \t\r";
  const std::size_t first = text.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return {};
  return std::string(text.substr(first, text.find_last_not_of(kBlanks) - first + 1));
}

/// A line in a form that tinyobjloader knows, which takes missing numbers for 0 and -halo for one.
std::string completed(std::string_view line) {
  std::istringstream words{std::string(line.substr(0, line.find('#')))};
  std::string key, first, second;
  words >> key >> first >> second;
  const bool is_color = key == "Kd" || key == "Ks" || key == "Ke" || key == "Tf";
  // One number is a grey.
  if (is_color && !first.empty() && second.empty())
    return fmt::format("{} {} {} {}", key, first, first, first);
  if (key == "d" && first == "-halo") return fmt::format("d {}", second);
  return std::string(line);
}

/// The text of a material file with numbers for the names of its materials, which go to `named`:
/// some versions of tinyobjloader end a name at its first blank.
std::string with_numbers(std::string_view text, std::vector<Named>& named) {
  constexpr std::string_view kKey = "newmtl";
  std::string out;
  out.reserve(text.size());
  while (!text.empty()) {
    const std::size_t end = std::min(text.find_first_of("\r\n"), text.size());
    const std::string_view line = text.substr(0, end);
    const std::size_t key = std::min(line.find_first_not_of(" \t"), line.size());
    std::string_view rest = line.substr(key);
    std::string name;
    if (rest.starts_with(kKey)) {
      rest.remove_prefix(kKey.size());
      if (rest.starts_with(' ') || rest.starts_with('\t')) name = trimmed(rest);
    }
    if (name.empty()) {
      if (!named.empty() && (rest.starts_with("Kd ") || rest.starts_with("Kd\t")))
        named.back().has_color = true;
      out += completed(line);
    } else {
      out += fmt::format("{} {}", kKey, named.size());
      named.push_back({std::move(name)});
    }
    out += text.substr(end, 1);
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return out;
}

/// Files written on Windows separate folders by backslashes.
std::filesystem::path relative_to(const std::filesystem::path& file, std::string name) {
  std::replace(name.begin(), name.end(), '\\', '/');
  return (file.parent_path() / name).lexically_normal();
}

/// Of a texture: a comment may follow its name, which may have a # as well.
std::filesystem::path texture_path(const std::filesystem::path& library, const std::string& name) {
  const std::filesystem::path path = relative_to(library, name);
  const std::size_t comment = std::min(name.find(" #"), name.find("\t#"));
  return comment == std::string::npos || is_file(path)
             ? path
             : relative_to(library, trimmed(name.substr(0, comment)));
}

}  // namespace

void MtlMaterials::add_library(std::string_view names) {
  const std::string whole = trimmed(names);
  // A name may hold blanks, although the format separates names by them.
  if (is_file(relative_to(obj_, whole))) {
    read_library(relative_to(obj_, whole));
    return;
  }
  std::istringstream words(whole);
  for (std::string name; words >> name;) {
    const std::filesystem::path path = relative_to(obj_, name);
    if (is_file(path)) {
      read_library(path);
    } else {
      spdlog::warn("{}: there is no material file {}, so its materials are the default one",
                   obj_.string(), path.string());
    }
  }
}

void MtlMaterials::read_library(const std::filesystem::path& path) {
  const std::vector<std::byte> bytes = read_file(path, kMaxLibraryBytes);
  std::string_view text(reinterpret_cast<const char*>(bytes.data()), bytes.size());
  // tinyobjloader would miss the first line.
  if (text.starts_with(kByteOrderMark)) text.remove_prefix(kByteOrderMark.size());
  std::vector<Named> named;
  std::istringstream stream{with_numbers(text, named)};
  std::map<std::string, int> indices;
  std::vector<tinyobj::material_t> read;
  std::string warnings;
  std::string errors;
  tinyobj::LoadMtl(&indices, &read, &stream, &warnings, &errors);
  for (const tinyobj::material_t& mtl : read) {
    std::size_t number = named.size();
    std::from_chars(mtl.name.data(), mtl.name.data() + mtl.name.size(), number);
    if (number >= named.size() || known_.contains(named[number].name)) continue;
    const std::string& name = named[number].name;
    known_.emplace(name, map_material(mtl, named[number]));
    const std::string map = trimmed(mtl.diffuse_texname);
    if (!map.empty()) texture_paths_.emplace(name, texture_path(path, map));
    if (!trimmed(mtl.alpha_texname).empty()) cut_out_.insert(name);
  }
}

int MtlMaterials::texture(const std::filesystem::path& path, const std::string& material) {
  const auto [entry, added] = loaded_.emplace(path, static_cast<int>(textures.size()));
  if (added) {
    try {
      textures.push_back(read_texture(path));
    } catch (const DataError& error) {
      throw DataError(fmt::format("The texture of the material '{}' of {} cannot be used: {}",
                                  material, obj_.string(), error.what()));
    }
  }
  return entry->second;
}

void MtlMaterials::use_all() {
  for (const auto& [name, material] : known_) index(name);
}

std::uint32_t MtlMaterials::index(std::string_view name) {
  const std::string key = trimmed(name);
  const auto [entry, added] = used_.emplace(key, static_cast<std::uint32_t>(materials.size()));
  if (!added) return entry->second;
  const auto found = known_.find(key);
  if (found != known_.end()) {
    Material material = found->second;
    const auto path = texture_paths_.find(key);
    const bool seen = !seen_ || seen_(key);
    if (seen && path != texture_paths_.end()) material.texture = texture(path->second, key);
    if (seen && !warned_of_cut_out_ && cut_out_.contains(key)) {
      warned_of_cut_out_ = true;
      spdlog::warn("{}: map_d of the material '{}' is left out: its triangles are seen whole",
                   obj_.string(), key);
    }
    materials.push_back(std::move(material));
  } else {
    if (!key.empty() && !known_.empty()) {
      spdlog::warn("{}: the material '{}' is in no material file, so it is the default one",
                   obj_.string(), key);
    }
    materials.emplace_back().name = key.empty() ? "default" : key;
  }
  return entry->second;
}

}  // namespace raysplats::io
