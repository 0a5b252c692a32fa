// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <filesystem>
#include <span>
#include <vector>

#include "raysplats/rays.hpp"

namespace raysplats::io {

/// Rays of a file in the order of its array, and the array's shape without the last index.
struct RayList {
  std::vector<std::size_t> shape;
  std::vector<Ray> rays;
};

/// Reads a .npy file of shape (..., 6) or (..., 8): origin and direction of every ray, and with 8
/// numbers t_min and t_max behind them; else a ray begins at 0 and has no end. The rays count from
/// `origin` (Dataset::origin), which is taken off in double precision. Throws DataError as
/// read_npy(), and for another shape.
RayList read_rays(const std::filesystem::path& path, const std::array<double, 3>& origin = {});

/// Writes what rays met as a .npz file: "color" (..., 3), "alpha", "depth", "median_depth" as
/// 32-bit floats, "hits" as 32-bit whole numbers, of the shape that the rays came in. Throws
/// DataError when the file cannot be written.
void write_ray_results(const std::filesystem::path& path,
                       const std::vector<std::size_t>& shape,
                       std::span<const RayResult> results);

}  // namespace raysplats::io
