// SPDX-License-Identifier: Apache-2.0
#include "io/dataset/data_origin.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <vector>

#include "scene/statistics.hpp"

namespace raysplats::io {
namespace {

constexpr double kFarAway = 200.0;   // sizes of the scene; single precision has 7 digits
constexpr double kLeastSize = 1e-6;  // of the distance: cameras in one place have no size
constexpr double kFarAnyway = 1e4;   // units, where nothing tells the size
constexpr double kNearest = 0.9;     // share of the cameras or points that is the scene

double quantile(std::vector<double> values, double q) {
  return quantiles(std::move(values), std::span<const double>(&q, 1))[0];
}

std::vector<double> distances_to(const glm::dvec3& center, std::span<const double> points) {
  std::vector<double> out(points.size() / 3);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const glm::dvec3 point(points[3 * i], points[3 * i + 1], points[3 * i + 2]);
    out[i] = glm::distance(point, center);
  }
  return out;
}

// To the power of ten below the size.
glm::dvec3 rounded(const glm::dvec3& center, double size) {
  const double unit = std::pow(10.0, std::floor(std::log10(size)));
  return unit * glm::round(center / unit) + 0.0;  // never -0
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
  // 0 for no points.
  size = std::max(size, quantile(distances_to(center, points), kNearest));
  const double away = glm::length(center);
  const double least = kLeastSize * away;
  if (size < least && away < kFarAnyway) return glm::dvec3(0.0);
  size = std::max(size, least);
  return away > kFarAway * size ? rounded(center, size) : glm::dvec3(0.0);
}

glm::dvec3 fitting_origin(const GaussianPlaces& places) {
  const glm::dvec3 center = places.median_position();
  const double away = glm::length(center);
  if (!std::isfinite(away) || !(blur_at(center) > unseen_blur(places.median_size())))
    return glm::dvec3(0.0);
  const double size = quantile(distances_to(center, places.positions()), kNearest);
  return rounded(center, std::max(size, kLeastSize * away));
}

void move_origin(Camera& camera, const glm::dvec3& origin) {
  camera.translation += camera.rotation * origin;
}

}  // namespace raysplats::io
