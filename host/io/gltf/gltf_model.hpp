// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tiny_gltf.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

namespace raysplats::io {

/// Parses a glTF 2.0 file, JSON or GLB, with its external buffers; images stay encoded
/// (GltfReader::image()), samplers have their wrapping alone, and skins, animations and cameras are
/// left out. Throws DataError for what read_gltf_document(), take_content() or tinygltf refuse.
tinygltf::Model parse_gltf(const std::filesystem::path& path);
/// The same of a file that has been read. One that stands alone must have all buffers in it, and
/// its images are left out: no file is opened.
tinygltf::Model parse_gltf(const std::filesystem::path& path,
                           std::span<const std::byte> bytes,
                           bool alone);

/// Untrusted parts of a parsed file, every index and range checked. Throws DataError with the
/// file's name.
class GltfReader {
 public:
  GltfReader(const tinygltf::Model& model, const std::filesystem::path& path)
      : model_(model), path_(path) {}

  /// The elements of an accessor, `components` numbers each; normalized integers become the values
  /// that they stand for.
  std::vector<float> floats(int accessor, std::size_t components) const;
  /// Vertex indices, not compared with the number of vertices.
  std::vector<std::uint32_t> indices(int accessor) const;
  /// The encoded content of an image. Throws DataError also when its file is missing.
  std::span<const std::byte> image(int image) const;
  [[noreturn]] void fail(const std::string& message) const;
  const tinygltf::Model& model() const { return model_; }
  const std::filesystem::path& path() const { return path_; }

 private:
  struct Elements {
    std::span<const std::byte> bytes;
    std::size_t stride;
    std::size_t count;
    int component_type;
    bool normalized;
  };
  Elements elements(int accessor, std::size_t components) const;
  std::span<const std::byte> view(int buffer_view) const;
  const tinygltf::Model& model_;
  std::filesystem::path path_;
};

}  // namespace raysplats::io
