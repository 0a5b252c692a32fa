// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "raysplats/camera.hpp"
#include "raysplats/dataset.hpp"

namespace raysplats::io {

struct ColmapImage {
  std::string name;
  std::uint32_t camera_id = 0;
  glm::dmat3 rotation{1.0};     ///< world to camera
  glm::dvec3 translation{0.0};  ///< world to camera
  std::uint32_t id = 0;
  std::vector<std::uint32_t> points;  ///< places of the points that it shows, ascending
};

/// What this program uses of a COLMAP sparse model.
struct ColmapModel {
  std::map<std::uint32_t, Camera> cameras;  ///< of the images, without name and pose
  std::vector<ColmapImage> images;          ///< sorted by name
  PointCloud points;
  std::vector<double> positions;  ///< of the points, as precise as in the file
};

/// The folder of the model to use below a data set: of sparse/*, sparse, colmap/sparse/*,
/// colmap/sparse, colmap (ScanNet++) and the root itself the one with most registered images, the
/// first in that order when several have as many; without any, of distorted/sparse/* and
/// distorted/sparse. Nothing when there is no model. Of several those that cannot be read are left
/// out with a warning; throws DataError when none can.
std::optional<std::filesystem::path> find_colmap_model(const std::filesystem::path& root);

/// Reads cameras, images and points3D (.bin, else .txt; points also .ply, as 3DGS leaves them) of a
/// folder. Points are optional, and
/// cameras that no image names are left out, whatever their lens. Throws DataError with byte offset
/// or line for malformed files, and for camera models that are none of COLMAP 4's: SIMPLE_PINHOLE,
/// PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, FULL_OPENCV without its rational terms (these become
/// kOpenCv, or kPinhole where nothing is distorted), SIMPLE_FISHEYE, FISHEYE,
/// SIMPLE_RADIAL_FISHEYE, RADIAL_FISHEYE and OPENCV_FISHEYE (kFisheye), EQUIRECTANGULAR, and as
/// kPhotoLens FULL_OPENCV, FOV, THIN_PRISM_FISHEYE, RAD_TAN_THIN_PRISM_FISHEYE, SIMPLE_DIVISION,
/// DIVISION and EUCM.
ColmapModel read_colmap_model(const std::filesystem::path& folder);

}  // namespace raysplats::io
