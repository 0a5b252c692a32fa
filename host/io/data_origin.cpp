// SPDX-License-Identifier: Apache-2.0
#include "io/data_origin.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <vector>

#include "scene/statistics.hpp"

namespace raysplats::io {
namespace {

constexpr double kFarAway = 200.0;   // sizes of the scene; single precision has 7 digits
constexpr double kLeastSize = 1e-6;  // of the distance: cameras in one place have no size
constexpr double kNearest = 0.9;     // share of the cameras or points that is the scene

double quantile(std::vector<double> values, double q) {
  return quantiles(std::move(values), std::span<const double>(&q, 1))[0];
}

}  // namespace

glm::dvec3 fitting_origin(std::span<const View> views, std::span<const double> points) {
  if (views.empty()) return glm::dvec3(0.0);
  glm::dvec3 center(0.0);
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (const View& view : views) values.push_back(view.camera.center()[axis]);
    center[axis] = quantile(std::move(values), 0.5);
  }
  std::vector<double> distances;
  for (const View& view : views) distances.push_back(glm::distance(view.camera.center(), center));
  double size = quantile(std::move(distances), kNearest);
  distances.clear();
  for (std::size_t i = 0; i + 2 < points.size(); i += 3) {
    distances.push_back(glm::distance(glm::dvec3(points[i], points[i + 1], points[i + 2]), center));
  }
  if (!distances.empty()) size = std::max(size, quantile(std::move(distances), kNearest));
  const double away = glm::length(center);
  size = std::max(size, kLeastSize * away);
  if (!(away > kFarAway * size)) return glm::dvec3(0.0);
  const double unit = std::pow(10.0, std::floor(std::log10(size)));
  return unit * glm::round(center / unit) + 0.0;  // never -0
}

void move_origin(Camera& camera, const glm::dvec3& origin) {
  camera.translation += camera.rotation * origin;
}

}  // namespace raysplats::io
