// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tiny_gltf.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <vector>

namespace raysplats::io {

/// A glTF 2.0 file as it is stored.
// nlohmann::json says that its moves throw nothing, and asserts in them.
struct GltfDocument {                                // NOLINT(bugprone-exception-escape)
  nlohmann::json json;                               ///< an object
  std::optional<std::span<const std::byte>> binary;  ///< the binary chunk of a GLB
};

/// Takes a glTF 2.0 file, JSON or GLB, apart; `path` names it in messages. Throws DataError for
/// chunks of a GLB that do not lie within the file, for JSON that is malformed or nested more than
/// 64 levels deep, and for extensions that are required but not known.
GltfDocument read_gltf_document(std::span<const std::byte> bytes,
                                const std::filesystem::path& path);

/// What the document's views and textures refer to.
struct GltfContent {
  std::vector<tinygltf::Buffer> buffers;  ///< without bytes where an extension is to bring them
  /// Still encoded, and without bytes where their file is missing or a buffer view has them.
  std::vector<tinygltf::Image> images;
};

/// Takes the buffers and images out of a document: from its binary chunk, its data: URIs and the
/// files beside it, at most `limit` bytes of these. One that stands alone must have all buffers in
/// it, and its images are left out: no file is opened. Throws DataError, also for a buffer's file
/// that is missing.
GltfContent take_content(GltfDocument& document,
                         const std::filesystem::path& path,
                         bool alone,
                         std::uint64_t limit);

/// The accessor of an attribute, -1 for none.
int attribute(const tinygltf::Primitive& primitive, const std::string& name);

}  // namespace raysplats::io
