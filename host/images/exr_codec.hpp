// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "io/image/image_codec.hpp"

namespace raysplats::io {

/// An EXR file of scanlines or tiles, its first part, of the display window, 0 where that has no
/// data: R, G, B and A, or Y and A, or those of a layer ("beauty.R"; one called Combined first), or
/// the only channel that it has. Its profile is what it says of primaries and white other than
/// those of Rec. 709. Throws DataError.
std::unique_ptr<ImageDecoder> open_exr(const std::string& path);

/// Of one that decodes: light that alpha multiplies, as the format has it, unless its attributes
/// say otherwise (encode_exr()). Throws DataError.
PhotoColors exr_colors(const std::string& path);

/// The bytes of an EXR file of 32-bit floats with Rec. 709 primaries, which says what its colours
/// are. Throws DataError that names `path`.
std::vector<unsigned char> encode_exr(const std::filesystem::path& path,
                                      const Image& image,
                                      const ImageEncoding& encoding);

}  // namespace raysplats::io
