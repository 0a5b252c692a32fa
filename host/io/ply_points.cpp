// SPDX-License-Identifier: Apache-2.0
#include "io/ply_points.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "io/ply_file.hpp"
#include "raysplats/error.hpp"

namespace raysplats::io {

PointCloud read_ply_points(const std::filesystem::path& path) {
  const PlyFile file(path);
  std::array<std::size_t, 3> position;
  std::array<std::size_t, 3> color{};
  const std::array<const char*, 3> position_names{"x", "y", "z"};
  const std::array<const char*, 3> color_names{"red", "green", "blue"};
  bool colored = true;
  double scale = 1.0;
  for (std::size_t i = 0; i < 3; ++i) {
    const auto column = file.column(position_names[i]);
    if (!column) {
      throw DataError(fmt::format("{} has no property '{}': it holds no points", path.string(),
                                  position_names[i]));
    }
    position[i] = *column;
    const auto color_column = file.column(color_names[i]);
    colored = colored && color_column.has_value();
    if (!color_column) continue;
    color[i] = *color_column;
    const PlyType type = file.properties()[color[i]].type;
    if (type == PlyType::kUint8) scale = 1.0 / 255.0;
    if (type == PlyType::kUint16) scale = 1.0 / 65535.0;
  }
  PointCloud points;
  points.positions.reserve(3 * file.rows());
  points.colors.reserve(3 * file.rows());
  double brightest = 0.0;
  file.for_each_row([&](std::size_t row, std::span<const double> values) {
    for (std::size_t i = 0; i < 3; ++i) {
      const auto coordinate = static_cast<float>(values[position[i]]);
      if (!std::isfinite(coordinate)) {
        throw DataError(fmt::format("{}: '{}' of point {} is not finite", path.string(),
                                    position_names[i], row));
      }
      points.positions.push_back(coordinate);
      double value = colored ? values[color[i]] * scale : 0.5;
      if (!std::isfinite(value)) value = 0.5;
      brightest = std::max(brightest, value);
      points.colors.push_back(static_cast<float>(value));
    }
  });
  // Floating-point and int colours state no range: more than 1 means 0 to 255.
  const float divisor = brightest > 1.0 ? 255.0f : 1.0f;
  for (float& value : points.colors) value = std::clamp(value / divisor, 0.0f, 1.0f);
  return points;
}

}  // namespace raysplats::io
