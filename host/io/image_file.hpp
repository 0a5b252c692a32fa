// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <span>
#include <string>

#include "raysplats/image.hpp"

namespace raysplats::io {

/// Size of an image file without its pixels.
struct ImageSize {
  int width = 0;
  int height = 0;
};

/// Reads the header of an image that read_image() accepts. Throws DataError as read_image() does.
ImageSize image_size(const std::filesystem::path& path);

/// read_image() of a PNG or JPEG file in memory; `name` stands for its path in errors.
Image decode_image(std::span<const std::byte> bytes, const std::string& name);

/// Whether read_image() knows the extension (.png, .jpg, .jpeg, .exr, .hdr, .tif, .tiff, .bmp in
/// any case).
bool has_image_extension(const std::filesystem::path& path);

}  // namespace raysplats::io
