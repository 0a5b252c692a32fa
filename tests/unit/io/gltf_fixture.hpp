// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <doctest/doctest.h>

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "io/mesh/mesh_file.hpp"
#include "unit/io/scratch.hpp"

namespace raysplats::test {

/// Builds glTF files byte by byte: one buffer, the rest as JSON.
struct GltfFile {
  nlohmann::json json;
  std::string buffer;

  GltfFile() {
    json["asset"]["version"] = "2.0";
    json["bufferViews"] = nlohmann::json::array();
    json["accessors"] = nlohmann::json::array();
  }

  int add_view(const std::string& bytes) {
    while (buffer.size() % 4 != 0) buffer.push_back('\0');
    json["bufferViews"].push_back(
        {{"buffer", 0}, {"byteOffset", buffer.size()}, {"byteLength", bytes.size()}});
    buffer += bytes;
    return static_cast<int>(json["bufferViews"].size()) - 1;
  }

  /// `type` and `component` as in the format: "VEC3", 5126 and so on.
  template <class T>
  int add_accessor(const std::vector<T>& values, const std::string& type, int component) {
    const std::size_t width = type == "SCALAR" ? 1 : (type == "VEC2" ? 2 : 3);
    std::string bytes;
    for (const T value : values) put(bytes, value);
    json["accessors"].push_back({{"bufferView", add_view(bytes)},
                                 {"componentType", component},
                                 {"count", values.size() / width},
                                 {"type", type}});
    return static_cast<int>(json["accessors"].size()) - 1;
  }
  int add_vec3(const std::vector<float>& values) { return add_accessor(values, "VEC3", 5126); }
  int add_vec2(const std::vector<float>& values) { return add_accessor(values, "VEC2", 5126); }
  int add_indices(const std::vector<std::uint16_t>& values) {
    return add_accessor(values, "SCALAR", 5123);
  }

  /// A mesh of one primitive; returns the primitive for further keys.
  nlohmann::json& add_mesh(int positions) {
    json["meshes"].push_back({{"primitives", {{{"attributes", {{"POSITION", positions}}}}}}});
    return json["meshes"].back()["primitives"][0];
  }

  /// The triangle (0,0,0) (1,0,0) (0,1,0) with a material.
  static GltfFile triangle_with(const nlohmann::json& material) {
    GltfFile file;
    auto& primitive = file.add_mesh(file.add_vec3({0, 0, 0, 1, 0, 0, 0, 1, 0}));
    primitive["material"] = 0;
    file.json["materials"].push_back(material);
    return file;
  }

  /// Two triangles over the unit square, whose buffer has 60 bytes.
  static GltfFile square() {
    GltfFile file;
    const int positions = file.add_vec3({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0});
    const int indices = file.add_indices({0, 1, 2, 2, 1, 3});
    file.add_mesh(positions)["indices"] = indices;
    return file;
  }

  /// A GLB: header, JSON chunk, binary chunk.
  std::string glb() const {
    nlohmann::json root = json;
    std::string bin = buffer;
    while (bin.size() % 4 != 0) bin.push_back('\0');
    root["buffers"].push_back({{"byteLength", bin.size()}});
    std::string text = root.dump();
    while (text.size() % 4 != 0) text.push_back(' ');
    std::string bytes = "glTF";
    put(bytes, std::uint32_t{2});
    put(bytes, static_cast<std::uint32_t>(12 + 8 + text.size() + 8 + bin.size()));
    put(bytes, static_cast<std::uint32_t>(text.size()));
    bytes += "JSON" + text;
    put(bytes, static_cast<std::uint32_t>(bin.size()));
    bytes += std::string("BIN\0", 4) + bin;
    return bytes;
  }

  /// The JSON of a .gltf whose buffer has this URI.
  std::string gltf(const std::string& uri) const {
    nlohmann::json root = json;
    root["buffers"].push_back({{"byteLength", buffer.size()}, {"uri", uri}});
    return root.dump();
  }
};

inline std::string base64(const std::string& bytes) {
  const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      group = group << 8 | (i + k < bytes.size() ? static_cast<std::uint8_t>(bytes[i + k]) : 0u);
    }
    for (std::size_t k = 0; k < 4; ++k) {
      text += i + k > bytes.size() ? '=' : digits[group >> (18 - 6 * k) & 63];
    }
  }
  return text;
}

/// The mesh of a file with these bytes.
inline io::MeshFile read_gltf_mesh(const std::string& bytes, const std::string& name = "m.glb") {
  const Scratch scratch;
  write_bytes(scratch / name, bytes);
  return io::read_mesh(scratch / name);
}

/// What reading it says: a short line that names the file.
inline std::string gltf_mesh_error(const std::string& bytes, const std::string& name = "m.glb") {
  const std::string message = data_error([&] { read_gltf_mesh(bytes, name); });
  CHECK(contains(message, name));
  CHECK(!contains(message, "\n"));
  CHECK(message.size() < 400);
  return message;
}

}  // namespace raysplats::test
