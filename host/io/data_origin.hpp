// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <glm/vec3.hpp>
#include <span>

#include "raysplats/camera.hpp"
#include "raysplats/dataset.hpp"

namespace raysplats::io {

/// Squares of distances have to stay within single precision, and scenes are near their cameras,
/// which may be no farther than this either.
constexpr double kFarthestOrigin = 1e9;

/// Where positions should count from, so that single precision does not blur a scene that lies far
/// from the origin of its coordinates (surveyed captures: metres of a map grid or from the earth's
/// centre): near the median of the cameras, rounded to the scene's size, where that is more than
/// 200 times as far away as the scene is large, else 0. Where all is in one place, which tells no
/// size, that is from 10 000 units on. `points`: x, y, z each, may be empty.
glm::dvec3 fitting_origin(std::span<const View> views, std::span<const double> points);

/// The same of points alone, x, y, z each, finite: near their median, rounded to how far they
/// spread, where single precision would shift them by more than a hundredth of `detail`, a length.
glm::dvec3 fitting_origin(std::span<const double> points, double detail);

/// The medians of x, of y and of z, which `points` has in turn; 0 for none.
glm::dvec3 median_point(std::span<const double> points);

/// How far single precision shifts what lies there.
double blur_at(const glm::dvec3& place);
/// The share of a detail by which it may shift without being seen.
constexpr double kUnseenBlur = 0.01;

/// The same pose counted from `origin`.
void move_origin(Camera& camera, const glm::dvec3& origin);

}  // namespace raysplats::io
