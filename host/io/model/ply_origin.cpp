// SPDX-License-Identifier: Apache-2.0
#include "io/model/ply_origin.hpp"

#include <algorithm>
#include <cmath>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "io/dataset/data_origin.hpp"

namespace raysplats::io {
namespace {

/// The columns of these names; none where one is missing.
std::vector<std::size_t> columns_of(const PlyFile& file, std::span<const char* const> names) {
  std::vector<std::size_t> out;
  for (const char* name : names) {
    const auto column = file.column(name);
    if (!column) return {};
    out.push_back(*column);
  }
  return out;
}

}  // namespace

std::array<double, 3> origin_of_doubles(const PlyFile& file) {
  constexpr std::array<const char*, 3> kPosition{"x", "y", "z"};
  constexpr std::array<const char*, 2> kScales{"scale_0", "scale_1"};
  const std::vector<std::size_t> position = columns_of(file, kPosition);
  std::vector<std::size_t> scales = columns_of(file, kScales);
  const bool doubles = std::any_of(position.begin(), position.end(), [&](std::size_t column) {
    return file.properties()[column].type == PlyType::kDouble;
  });
  if (!doubles || scales.empty()) return {};
  if (const auto third = file.column("scale_2")) scales.push_back(*third);
  GaussianPlaces places;
  file.for_each_row([&](std::size_t, std::span<const double> values) {
    double log_size = -HUGE_VAL;
    for (const std::size_t column : scales) log_size = std::max(log_size, values[column]);
    const glm::dvec3 place(values[position[0]], values[position[1]], values[position[2]]);
    // The others are for whoever reads them.
    if (!std::isfinite(place.x + place.y + place.z) || !std::isfinite(log_size)) return;
    places.add(place, log_size);
  });
  const glm::dvec3 origin = fitting_origin(places);
  return {origin.x, origin.y, origin.z};
}

}  // namespace raysplats::io
