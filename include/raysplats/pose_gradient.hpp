// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

namespace raysplats {

/// Gradient of a loss for the pose of a camera.
struct PoseGradient {
  std::array<double, 3> center{};  ///< for moving the camera's centre along the axes of the world
  /// The gradient for a small turn w about the centre, in camera axes and radians: rotation :=
  /// exp([w]x) * rotation of the world-to-camera matrix, the centre stays.
  std::array<double, 3> rotation{};
};

}  // namespace raysplats
