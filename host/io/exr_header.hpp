// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

namespace raysplats::io {

/// Walks the header of an OpenEXR file ("The OpenEXR file layout", openexr.com): OpenEXR asks for
/// the memory that a header names before it looks whether the file has as much. Throws DataError
/// with the byte offset when an attribute is longer than the file, or the picture, its tiles or
/// its chunks are larger than a side of `max_side` pixels allows.
void check_exr_header(const std::filesystem::path& path, int max_side);

}  // namespace raysplats::io
