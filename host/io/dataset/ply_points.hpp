// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "raysplats/dataset.hpp"

namespace raysplats::io {

struct PlyPoints {
  PointCloud cloud;
  std::vector<double> positions;  ///< x, y, z each, as precise as in the file
  bool colored = false;
};

/// Points of a PLY with x, y, z and, when present, their colours: red, green, blue, the same behind
/// diffuse_, or r, g, b (integers of their type's range, or floating point in [0, 1] or [0, 255]);
/// mid-grey without. Points whose place is not finite are left out with a warning. Throws DataError
/// as read_ply() does.
PlyPoints read_ply_points(const std::filesystem::path& path);

/// Warns of points of a file that are left out because they are not finite, if there are any.
void warn_of_points(const std::filesystem::path& path, std::size_t left_out, std::size_t all);

}  // namespace raysplats::io
