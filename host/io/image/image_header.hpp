// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <string_view>

#include "io/image/image_file.hpp"

namespace raysplats::io {

/// OpenImageIO's name of the format that the first bytes of a file belong to; "" for any other.
std::string_view format_of(std::string_view magic);

/// TGA has no magic number: whether these can be the kinds of palette and picture, and the bits of
/// a pixel, of its header (Truevision, version 2.0).
bool is_targa(std::string_view start);

/// Width and height as the header of a "png" or "jpeg" file states them, so that thousands of
/// photos are known without the library of pictures; nothing for other formats and for headers
/// that only that library may understand. Reads a few bytes, not the picture.
std::optional<ImageSize> size_in_header(const std::filesystem::path& path, std::string_view format);

/// Whether a file may hold an ICC profile: for "png" and "jpeg" what their headers say, for other
/// formats yes.
bool may_have_profile(const std::filesystem::path& path, std::string_view format);

/// Whether a file may have transparent pixels: not JPEG and HDR, of PNG what the header says, any
/// other.
bool may_be_transparent(const std::filesystem::path& path);

/// Whether the header of a "bmp" or "targa" file says that pixels have alpha; others have what they
/// say. Those that say nothing have it all the same, or 0 in a byte that is not used.
bool states_alpha(const std::filesystem::path& path, std::string_view format);

/// The exponent that made the numbers of a PNG of light, about 0.45 of display values, where its
/// chunk gAMA alone says it; nothing for other files, and where a profile or sRGB goes before it.
std::optional<double> png_gamma(const std::filesystem::path& path);

}  // namespace raysplats::io
