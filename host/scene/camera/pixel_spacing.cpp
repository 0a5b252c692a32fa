// SPDX-License-Identifier: Apache-2.0
#include "scene/camera/pixel_spacing.hpp"

#include <algorithm>
#include <numbers>

namespace raysplats {

double pixel_spacing(const Camera& camera) {
  switch (camera.model) {
    case CameraModel::kPinhole:
    case CameraModel::kOpenCv:
    case CameraModel::kFisheye:
    case CameraModel::kOrthographic:
      return 1.0 / std::max(camera.fx, camera.fy);
    case CameraModel::kEquirectangular:
      return 2.0 * std::numbers::pi / camera.width;
    case CameraModel::kPhotoLens:
      break;
  }
  return 0.0;
}

float footprint_width(const Camera& camera, float footprint) {
  return static_cast<float>(static_cast<double>(footprint) * pixel_spacing(camera));
}

}  // namespace raysplats
