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

}  // namespace raysplats::io
