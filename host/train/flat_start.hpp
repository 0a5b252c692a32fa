// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "raysplats/camera.hpp"
#include "raysplats/gaussians.hpp"

namespace raysplats {

/// Thickness of a flat Gaussian, as a share of the smaller of its other two axes.
constexpr double kFlatness = 0.01;
/// Flat Gaussians have to find their orientation: by so much faster than others they turn.
constexpr double kFlatTurn = 10;

/// Makes Gaussians flat: the shortest axis becomes the third and kFlatness of the smaller of the
/// others. Those without a shortest axis, as starts from points are, turn it to the nearest camera.
void flatten(Gaussians& model, std::span<const Camera> cameras);

}  // namespace raysplats
