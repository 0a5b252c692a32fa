// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "raysplats/camera.hpp"

namespace raysplats {

/// Throws DataError, which names `what` ("the camera of a.png"), for a camera that no photo can
/// have been taken with: one that is more than 1e9 from the origin or whose lens moves the corner
/// of the picture to a thousand times its distance from the centre.
void require_believable(const Camera& camera, const std::string& what);

}  // namespace raysplats
