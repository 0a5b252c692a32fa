// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "raysplats/image.hpp"

namespace raysplats::io {

/// Reads a picture that surfaces or the environment show: 3 channels of display values, which may
/// be above 1. What a file holds as light (EXR, HDR) goes through the sRGB curve. Floats that no
/// light can have become the nearest in [0, 1e6], NaN 0, with a warning that names the file. Throws
/// DataError as read_image().
Image read_texture(const std::filesystem::path& path);

}  // namespace raysplats::io
