// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <span>
#include <string>

#include "io/image/image_codec.hpp"
#include "raysplats/image.hpp"

namespace raysplats::io {

/// What the header of an image file says.
struct ImageSize {
  int width = 0;
  int height = 0;
  int sample_bytes = 1;  ///< of a number: 1, 2 or 4 (floats)
};

/// Reads the header of an image that read_image() accepts. Throws DataError as read_image() does.
ImageSize image_size(const std::filesystem::path& path);

/// The EXIF orientation of such an image; 1 (upright) where it says none. Throws DataError.
int image_orientation(const std::filesystem::path& path);

/// The name of the ICC profile of its red, green and blue, as far as the library of pictures tells
/// (JPEG, PNG, TIFF), of an EXR its chromaticities where they are not sRGB's; "" without one.
/// Throws DataError.
std::string color_profile(const std::filesystem::path& path);

/// read_image() without a conversion of its numbers.
RawImage read_raw_image(const std::filesystem::path& path);

/// The same of what no colours are: integers as the file has them, no shares of the greatest.
RawImage read_stored_numbers(const std::filesystem::path& path);

/// read_image() of a PNG or JPEG file in memory; `name` stands for its path in errors.
Image decode_image(std::span<const std::byte> bytes, const std::string& name);

/// The extensions that read_image() knows; it takes them in any case.
constexpr std::array<const char*, 15> kImageExtensions{".png", ".jpg",  ".jpeg", ".jfif", ".exr",
                                                       ".tif", ".tiff", ".webp", ".bmp",  ".hdr",
                                                       ".gif", ".tga",  ".heic", ".heif", ".avif"};

/// Whether read_image() knows the extension.
bool has_image_extension(const std::filesystem::path& path);
/// The same of a file that a listing of photos may count: none that macOS has left beside one
/// (is_apple_double()).
bool is_photo_name(const std::filesystem::path& path);

}  // namespace raysplats::io
