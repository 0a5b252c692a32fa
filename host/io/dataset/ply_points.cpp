// SPDX-License-Identifier: Apache-2.0
#include "io/dataset/ply_points.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>

#include "io/ply_file.hpp"
#include "raysplats/error.hpp"

namespace raysplats::io {
namespace {

using Names = std::array<const char*, 3>;

/// The columns of all three, or nothing.
std::optional<std::array<std::size_t, 3>> columns(const PlyFile& file, const Names& names) {
  std::array<std::size_t, 3> out{};
  for (std::size_t i = 0; i < 3; ++i) {
    const auto column = file.column(names[i]);
    if (!column) return std::nullopt;
    out[i] = *column;
  }
  return out;
}

std::optional<std::array<std::size_t, 3>> color_columns(const PlyFile& file) {
  for (const Names& names :
       {Names{"red", "green", "blue"}, Names{"diffuse_red", "diffuse_green", "diffuse_blue"},
        Names{"r", "g", "b"}}) {
    if (const auto found = columns(file, names)) return found;
  }
  return std::nullopt;
}

/// The greatest number of an integer type; 1 of others, which state no range.
double range_of(PlyType type) {
  if (type == PlyType::kUint8) return 255.0;
  return type == PlyType::kUint16 ? 65535.0 : 1.0;
}

}  // namespace

PlyPoints read_ply_points(const std::filesystem::path& path) {
  const PlyFile file(path);
  const Names position_names{"x", "y", "z"};
  for (const char* name : position_names) {
    if (!file.column(name)) {
      throw DataError(
          fmt::format("{} has no property '{}': it holds no points", path.string(), name));
    }
  }
  const std::array<std::size_t, 3> position = *columns(file, position_names);
  const auto color = color_columns(file);
  std::array<double, 3> scale{1.0, 1.0, 1.0};
  for (std::size_t i = 0; color && i < 3; ++i)
    scale[i] = 1.0 / range_of(file.properties()[(*color)[i]].type);
  PlyPoints out;
  out.colored = color.has_value();
  PointCloud& points = out.cloud;
  points.positions.reserve(3 * file.rows());
  points.colors.reserve(3 * file.rows());
  out.positions.reserve(3 * file.rows());
  double brightest = 0.0;
  std::size_t left_out = 0;
  file.for_each_row([&](std::size_t, std::span<const double> values) {
    const bool finite = std::all_of(position.begin(), position.end(), [&](std::size_t column) {
      return std::isfinite(static_cast<float>(values[column]));
    });
    if (!finite) {
      ++left_out;
      return;
    }
    for (std::size_t i = 0; i < 3; ++i) {
      points.positions.push_back(static_cast<float>(values[position[i]]));
      out.positions.push_back(values[position[i]]);
      double value = color ? values[(*color)[i]] * scale[i] : 0.5;
      if (!std::isfinite(value)) value = 0.5;
      brightest = std::max(brightest, value);
      points.colors.push_back(static_cast<float>(value));
    }
  });
  warn_of_points(path, left_out, file.rows());
  // Floating-point and int colours state no range: more than 1 means 0 to 255.
  const float divisor = brightest > 1.0 ? 255.0f : 1.0f;
  for (float& value : points.colors) value = std::clamp(value / divisor, 0.0f, 1.0f);
  return out;
}

void warn_of_points(const std::filesystem::path& path, std::size_t left_out, std::size_t all) {
  if (left_out == 0) return;
  spdlog::warn("{}: {} of {} points have a coordinate that is not finite and are left out",
               path.string(), left_out, all);
}

}  // namespace raysplats::io
