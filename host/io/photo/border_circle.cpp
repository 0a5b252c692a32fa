// SPDX-License-Identifier: Apache-2.0
#include "io/photo/border_circle.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/mat2x2.hpp>
#include <glm/matrix.hpp>
#include <vector>

#include "io/photo/body_outline.hpp"
#include "scene/camera/photo_lens.hpp"
#include "scene/even_choice.hpp"

namespace raysplats::io {
namespace {

// How far ends may lie off the circle and how large it is at least, as shares of the photo's
// shorter side, and the share of the ends that lie on it.
constexpr double kMostOffCircle = 0.02;
constexpr double kLeastRadius = 0.4;
constexpr double kLeastOnCircle = 0.8;
constexpr double kLeastEnds = 0.25;  // of as many as the photo's shorter side has pixels

bool is_fisheye(const Camera& photo) {
  return photo.model == CameraModel::kFisheye ||
         (photo.lens && photo.lens->form == PhotoLens::Form::kFisheye);
}

// Least squares of |p|^2 = 2 c p + r^2 - |c|^2 (Kasa 1976), about the points' mean.
Circle fitted_circle(std::span<const glm::dvec2> points) {
  glm::dvec2 mean(0.0);
  for (const glm::dvec2& p : points) mean += p / static_cast<double>(points.size());
  glm::dmat2 squares(0.0);
  glm::dvec2 moments(0.0);
  double size = 0;
  for (const glm::dvec2& p : points) {
    const glm::dvec2 d = p - mean;
    squares += glm::outerProduct(d, d);
    moments += d * glm::dot(d, d) / 2.0;
    size += glm::dot(d, d) / static_cast<double>(points.size());
  }
  if (!(std::abs(glm::determinant(squares)) > 0)) return {};
  const glm::dvec2 center = glm::inverse(squares) * moments;
  return {mean + center, std::sqrt(glm::dot(center, center) + size)};
}

}  // namespace

double Circle::off(const glm::dvec2& point) const {
  return std::abs(glm::distance(point, center) - radius);
}

std::optional<Circle> circle_of(const BlackEdges& edges) {
  std::vector<glm::dvec2> ends = edges.ends();
  const double side = std::min(edges.width, edges.height);
  if (static_cast<double>(ends.size()) < kLeastEnds * side) return std::nullopt;
  const std::size_t all = ends.size();
  Circle circle = fitted_circle(ends);
  // Once more without what is dark beside it.
  std::erase_if(ends,
                [&](const glm::dvec2& p) { return circle.off(p) > 2 * kMostOffCircle * side; });
  if (ends.size() < 3) return std::nullopt;
  circle = fitted_circle(ends);
  const auto on = std::count_if(ends.begin(), ends.end(), [&](const glm::dvec2& p) {
    return circle.off(p) <= kMostOffCircle * side;
  });
  const double most = std::hypot(edges.width, edges.height);  // larger ones are straight edges
  const bool found = circle.radius >= kLeastRadius * side && circle.radius <= most &&
                     static_cast<double>(on) >= kLeastOnCircle * static_cast<double>(all);
  return found ? std::optional(circle) : std::nullopt;
}

bool is_of_lens(const Circle& circle, const BlackEdges& edges, std::span<const Camera> cameras) {
  const std::vector<glm::dvec2> ends = edges.ends();
  std::vector<EdgePoint> points;
  for (const std::size_t i : even_choice(ends.size(), kOutlinePoints))
    points.push_back({ends[i], glm::normalize(circle.center - ends[i])});
  if (outline_misfit(cameras, points, RoundBody::kBall) >= kMostOutlineMisfit) return true;
  return is_fisheye(cameras.front()) && !look_around(cameras);
}

}  // namespace raysplats::io
