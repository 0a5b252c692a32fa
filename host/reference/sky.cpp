// SPDX-License-Identifier: Apache-2.0
#include "reference/sky.hpp"

#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

namespace raysplats::reference {
namespace {

int degree_of(const SkyLight& sky) {
  return static_cast<int>(std::lround(std::sqrt(static_cast<double>(sky.size())))) - 1;
}

// Before it is cut off at 0.
glm::dvec3 sky_sum(const SkyLight& sky, const glm::dvec3& unit) {
  const auto basis = sh_basis(degree_of(sky), unit);
  glm::dvec3 out(0.5);
  for (std::size_t k = 0; k < sky.size(); ++k)
    out += basis[k] * glm::dvec3(sky[k][0], sky[k][1], sky[k][2]);
  return out;
}

}  // namespace

glm::dvec3 light_behind(const TraceOptions& options, const glm::dvec3& direction) {
  if (options.sky.empty())
    return {options.background[0], options.background[1], options.background[2]};
  return glm::max(sky_sum(options.sky, glm::normalize(direction)), glm::dvec3(0.0));
}

glm::dvec3 light_behind_gradient(const TraceOptions& options,
                                 const glm::dvec3& direction,
                                 const glm::dvec3& color_gradient) {
  if (options.sky.empty()) return glm::dvec3(0.0);
  const double length = glm::length(direction);
  const glm::dvec3 unit = direction / length;
  const glm::dvec3 color = sky_sum(options.sky, unit);
  const auto basis_gradient = sh_basis_gradient(degree_of(options.sky), unit);
  glm::dvec3 by_unit(0.0);
  for (std::size_t k = 0; k < options.sky.size(); ++k) {
    for (std::size_t c = 0; c < 3; ++c) {
      const int channel = static_cast<int>(c);
      if (color[channel] <= 0.0) continue;
      by_unit +=
          color_gradient[channel] * static_cast<double>(options.sky[k][c]) * basis_gradient[k];
    }
  }
  return (by_unit - unit * glm::dot(unit, by_unit)) / length;
}

std::vector<double> sky_gradient(const TraceOptions& options,
                                 const glm::dvec3& direction,
                                 const glm::dvec3& color_gradient) {
  const glm::dvec3 unit = glm::normalize(direction);
  const glm::dvec3 color = sky_sum(options.sky, unit);
  const auto basis = sh_basis(degree_of(options.sky), unit);
  std::vector<double> out(3 * options.sky.size());
  for (std::size_t c = 0; c < 3; ++c) {
    const int channel = static_cast<int>(c);
    if (color[channel] <= 0.0) continue;
    for (std::size_t k = 0; k < options.sky.size(); ++k)
      out[3 * k + c] = color_gradient[channel] * basis[k];
  }
  return out;
}

}  // namespace raysplats::reference
