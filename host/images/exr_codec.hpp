// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "io/image_codec.hpp"

namespace raysplats::io {

/// An EXR file of scanlines or tiles, its first part: R, G, B and A, or Y and A, or else the first
/// channels that it has, at most 4, of the data window. Throws DataError.
std::unique_ptr<ImageDecoder> open_exr(const std::string& path);

/// The bytes of an EXR file of 32-bit floats with Rec. 709 primaries. Throws DataError that names
/// `path`.
std::vector<unsigned char> encode_exr(const std::filesystem::path& path,
                                      const Image& image,
                                      const ImageEncoding& encoding);

}  // namespace raysplats::io
