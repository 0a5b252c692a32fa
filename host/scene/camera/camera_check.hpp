// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <glm/mat3x3.hpp>
#include <string>

#include "raysplats/camera.hpp"

namespace raysplats {

/// Largest side of a picture: 24 bits of a float still tell apart the sixteenths of its last pixel.
constexpr int kMaxSide = 1 << 20;

/// Fields of view that an option or a file may ask for, in degrees: from kLeastFov to most_fov().
constexpr double kLeastFov = 0.001;
/// 360 for kFisheye; a plane ends before 180.
constexpr double most_fov(CameraModel model) {
  return model == CameraModel::kFisheye ? 360.0 : 179.9;
}

/// Deviation from a rotation that rounding may cause: of files, and of single precision.
constexpr double kRotationTolerance = 1e-3;

/// Whether the columns have length 1 and right angles, up to `tolerance` in any of their products,
/// and do not mirror.
bool is_rotation(const glm::dmat3& matrix, double tolerance = kRotationTolerance);

/// Throws UsageError for a camera without pixels or focal length, with a number that is not finite,
/// with a rotation that is none, or of CameraModel::kPhotoLens.
void require_pixels(const Camera& camera);

/// Throws DataError, which names `what` ("the camera of a.png"), for a camera that no photo can
/// have been taken with: one that is more than 1e9 from the origin or whose lens moves the corner
/// of the picture to a thousand times its distance from the centre.
void require_believable(const Camera& camera, const std::string& what);

}  // namespace raysplats
