// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "raysplats/camera.hpp"
#include "raysplats/gaussians.hpp"

namespace raysplats {

/// Turns the third axis of Gaussians without a shortest axis, as starts from points are, to the
/// nearest camera: what is flat from there on shows its face.
void face_cameras(Gaussians& model, std::span<const Camera> cameras);

}  // namespace raysplats
