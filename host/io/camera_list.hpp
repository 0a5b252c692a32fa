// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "raysplats/camera.hpp"

namespace raysplats::io {

/// The cameras of a cameras.json as RunFolder::write_cameras() and other trainers of 3DGS write it:
/// pinholes that look through the middle of their pictures, since it says neither lens nor centre,
/// and panoramas, which have no focal lengths. Nothing for entries that are no view with position,
/// rotation, width and height. Throws DataError for a file that is no JSON.
std::vector<std::optional<Camera>> read_camera_list(const std::filesystem::path& path);

}  // namespace raysplats::io
