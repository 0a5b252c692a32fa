// SPDX-License-Identifier: Apache-2.0
#include "io/gltf/gltf_document.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>
#include <limits>
#include <string>
#include <string_view>
#include <utility>

#include "io/byte_reader.hpp"
#include "io/data_uri.hpp"
#include "io/json_file.hpp"
#include "io/text_reader.hpp"
#include "raysplats/error.hpp"

namespace raysplats::io {
namespace {

using nlohmann::json;

constexpr std::string_view kGlbMagic = "glTF";
constexpr std::uint32_t kJsonChunk = 0x4e4f534a;    // "JSON"
constexpr std::uint32_t kBinaryChunk = 0x004e4942;  // "BIN"
constexpr int kMaxDepth = 64;

/// What a file may require: what is read, and what refines a surface that is shown well enough
/// without.
constexpr std::array<std::string_view, 18> kKnownExtensions{"KHR_gaussian_splatting",
                                                            "KHR_lights_punctual",
                                                            "KHR_materials_anisotropy",
                                                            "KHR_materials_clearcoat",
                                                            "KHR_materials_diffuse_transmission",
                                                            "KHR_materials_dispersion",
                                                            "KHR_materials_emissive_strength",
                                                            "KHR_materials_ior",
                                                            "KHR_materials_iridescence",
                                                            "KHR_materials_pbrSpecularGlossiness",
                                                            "KHR_materials_sheen",
                                                            "KHR_materials_specular",
                                                            "KHR_materials_transmission",
                                                            "KHR_materials_unlit",
                                                            "KHR_materials_variants",
                                                            "KHR_materials_volume",
                                                            "KHR_mesh_quantization",
                                                            "KHR_texture_transform"};

[[noreturn]] void fail(const std::filesystem::path& path, const std::string& message) {
  throw DataError(fmt::format("{} is no valid glTF file: {}", path.string(), message));
}

struct Chunks {
  std::span<const std::byte> json;
  std::span<const std::byte> binary;
};

/// The chunks of a GLB, which lie within the file (glTF 2.0, section 4.4).
Chunks glb_chunks(std::span<const std::byte> bytes, const std::filesystem::path& path) {
  ByteReader reader(bytes, path);
  reader.skip(kGlbMagic.size(), "the magic number");
  const auto version = reader.read<std::uint32_t>("the version");
  if (version != 2) {
    throw DataError(
        fmt::format("{} is glTF of version {}, but only 2 is known", path.string(), version));
  }
  const auto length = reader.read<std::uint32_t>("the length");
  if (length > bytes.size()) {
    throw DataError(
        fmt::format("{} is truncated: it has {} bytes of {}", path.string(), bytes.size(), length));
  }
  Chunks chunks;
  while (reader.offset() < length) {
    const auto size = reader.read<std::uint32_t>("the length of a chunk");
    const auto type = reader.read<std::uint32_t>("the type of a chunk");
    const bool first = chunks.json.empty();
    if (first && type != kJsonChunk) reader.fail("the first chunk holds no JSON");
    const std::size_t begin = reader.offset();
    reader.skip(size, first ? "the JSON" : "a chunk");
    if (first) {
      chunks.json = bytes.subspan(begin, size);
    } else if (type == kBinaryChunk && chunks.binary.empty()) {
      chunks.binary = bytes.subspan(begin, size);
    }
  }
  if (chunks.json.empty()) reader.fail("there is no JSON");
  return chunks;
}

void check_extensions(const json& document, const std::filesystem::path& path) {
  const auto required = document.find("extensionsRequired");
  if (required == document.end() || !required->is_array()) return;
  for (const json& each : *required) {
    if (!each.is_string()) fail(path, "the name of a required extension is no text");
    const auto& name = each.get_ref<const std::string&>();
    if (std::find(kKnownExtensions.begin(), kKnownExtensions.end(), name) !=
        kKnownExtensions.end()) {
      continue;
    }
    throw DataError(
        fmt::format("{} needs the extension {}, which is not supported: export it without",
                    path.string(), name));
  }
}

/// Reads what URIs stand for.
class ContentReader {
 public:
  ContentReader(const std::filesystem::path& path, bool alone, std::uint64_t limit)
      : path_(path), alone_(alone), left_(limit) {}

  tinygltf::Buffer buffer(const json& from, std::size_t number, const GltfDocument& document) {
    const std::string name = fmt::format("the buffer {}", number);
    const auto length = from.find("byteLength");
    if (length == from.end() || !length->is_number_unsigned()) {
      fail(path_, fmt::format("{} has no byteLength", name));
    }
    const auto size = length->get<std::uint64_t>();
    tinygltf::Buffer buffer;
    if (const std::string* uri = uri_of(from)) {
      if (!is_data_uri(*uri) && !exists(*uri)) {
        fail(path_, fmt::format("{} is in {}, which does not exist", name,
                                excerpt(percent_decoded(*uri))));
      }
      buffer.data = is_data_uri(*uri) ? embedded(*uri, name) : file(*uri);
    } else if (number == 0 && document.binary) {
      const auto* begin = reinterpret_cast<const unsigned char*>(document.binary->data());
      buffer.data.assign(begin, begin + std::min<std::uint64_t>(size, document.binary->size()));
    } else {
      return buffer;
    }
    if (buffer.data.size() < size) {
      fail(path_, fmt::format("{} has {} bytes of {}", name, buffer.data.size(), size));
    }
    buffer.data.resize(size);
    return buffer;
  }

  tinygltf::Image image(const json& from, std::size_t number) {
    tinygltf::Image image;
    if (const std::string* uri = uri_of(from)) {
      if (is_data_uri(*uri)) {
        image.image = embedded(*uri, fmt::format("the image {}", number));
      } else {
        image.uri = *uri;
        // Only a picture that is used has to be there.
        if (exists(*uri)) image.image = file(*uri);
      }
    } else if (const auto view = from.find("bufferView");
               view != from.end() && view->is_number_unsigned()) {
      constexpr std::uint64_t kLargest = std::numeric_limits<int>::max();
      image.bufferView = static_cast<int>(std::min(view->get<std::uint64_t>(), kLargest));
    }
    return image;
  }

 private:
  static const std::string* uri_of(const json& from) {
    const auto uri = from.find("uri");
    return uri != from.end() && uri->is_string() ? &uri->get_ref<const std::string&>() : nullptr;
  }

  std::vector<unsigned char> embedded(const std::string& uri, const std::string& name) const {
    std::optional<std::vector<unsigned char>> bytes = decode_data_uri(uri);
    if (!bytes) fail(path_, fmt::format("{} has a data: URI that cannot be decoded", name));
    return std::move(*bytes);
  }

  std::filesystem::path place_of(const std::string& uri) const {
    if (alone_) {
      throw DataError(
          "The glTF file names other files, which are not read here: export it as one GLB");
    }
    return path_.parent_path() / percent_decoded(uri);
  }

  bool exists(const std::string& uri) const {
    std::error_code error;
    return std::filesystem::is_regular_file(place_of(uri), error);
  }

  std::vector<unsigned char> file(const std::string& uri) {
    const std::vector<std::byte> bytes = read_file(place_of(uri), left_);
    left_ -= bytes.size();
    const auto* begin = reinterpret_cast<const unsigned char*>(bytes.data());
    return {begin, begin + bytes.size()};
  }

  const std::filesystem::path& path_;
  bool alone_;
  std::uint64_t left_;  ///< many buffers may name one large file
};

}  // namespace

GltfDocument read_gltf_document(std::span<const std::byte> bytes,
                                const std::filesystem::path& path) {
  GltfDocument document;
  std::span<const std::byte> text = bytes;
  if (bytes.size() >= kGlbMagic.size() &&
      std::memcmp(bytes.data(), kGlbMagic.data(), kGlbMagic.size()) == 0) {
    const Chunks chunks = glb_chunks(bytes, path);
    text = chunks.json;
    document.binary = chunks.binary;
  }
  document.json = parse_json_object(text, path, kMaxDepth);
  check_extensions(document.json, path);
  return document;
}

GltfContent take_content(GltfDocument& document,
                         const std::filesystem::path& path,
                         bool alone,
                         std::uint64_t limit) {
  ContentReader reader(path, alone, limit);
  GltfContent content;
  const auto take = [&](const char* key, const char* what, const auto& add) {
    const auto list = document.json.find(key);
    if (list == document.json.end()) return;
    if (!list->is_array()) fail(path, fmt::format("{} is no list", key));
    for (std::size_t i = 0; i < list->size(); ++i) {
      const json& from = (*list)[i];
      if (!from.is_object()) fail(path, fmt::format("the {} {} is no object", what, i));
      add(from, i);
    }
    document.json.erase(list);
  };
  take("buffers", "buffer", [&](const json& from, std::size_t i) {
    content.buffers.push_back(reader.buffer(from, i, document));
  });
  take("images", "image", [&](const json& from, std::size_t i) {
    if (!alone) content.images.push_back(reader.image(from, i));
  });
  return content;
}

int attribute(const tinygltf::Primitive& primitive, const std::string& name) {
  const auto found = primitive.attributes.find(name);
  return found == primitive.attributes.end() ? -1 : found->second;
}

}  // namespace raysplats::io
