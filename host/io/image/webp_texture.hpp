// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

namespace raysplats::io {

/// Four bytes a texel, rows from the top. Numbers, no colours: nothing is multiplied by alpha.
struct Texture {
  std::size_t width = 0, height = 0;
  std::vector<std::uint8_t> rgba;

  std::size_t texels() const { return width * height; }
};

/// The texels that a texture may have.
struct TexelRange {
  std::size_t least = 0, most = 0;
};

/// The size that the header of a lossless WebP says, without texels; throws DataError that begins
/// with `name` for anything else and for sizes out of range.
Texture texture_size(std::span<const std::byte> bytes, TexelRange range, const std::string& name);
/// Decodes what texture_size() accepts, and throws as it does before memory is asked for.
Texture decode_texture(std::span<const std::byte> bytes, TexelRange range, const std::string& name);

/// Greatest width and height of WebP.
constexpr std::size_t kMostTextureSide = 16383;
/// Lossless, bytes of transparent texels included; at most kMostTextureSide wide and high, and not
/// empty.
std::vector<std::byte> encode_texture(const Texture& texture);

}  // namespace raysplats::io
