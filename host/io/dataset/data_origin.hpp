// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <glm/vec3.hpp>
#include <span>

#include "io/model/float_blur.hpp"
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

/// The same of Gaussians alone, all finite: near their median, rounded to how far they spread,
/// where single precision would shift them so far that it is seen.
glm::dvec3 fitting_origin(const GaussianPlaces& places);

/// The same pose counted from `origin`.
void move_origin(Camera& camera, const glm::dvec3& origin);

}  // namespace raysplats::io
