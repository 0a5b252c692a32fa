// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "raysplats/dataset.hpp"

namespace raysplats::io {

/// Points of a PLY with x, y, z and, when present, red, green, blue (integers of their type's
/// range, or floating point in [0, 1] or [0, 255]); mid-grey without colours. Throws DataError as
/// read_ply() does.
PointCloud read_ply_points(const std::filesystem::path& path);

}  // namespace raysplats::io
