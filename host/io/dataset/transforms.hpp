// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "raysplats/camera.hpp"

namespace raysplats::io {

/// Intrinsics of one frame, as far as the file states them.
struct TransformsFrame {
  std::size_t number = 0;       ///< in the file
  std::string file_path;        ///< as in the file; may be empty
  std::string mask_path;        ///< as in the file; usually empty
  std::string depth_path;       ///< likewise
  std::filesystem::path photo;  ///< the file that transforms_views() found
  bool moved = false;           ///< by the end of file_path, which was written elsewhere
  std::optional<int> width, height;
  std::optional<double> fx, fy, cx, cy;       ///< pixels
  std::optional<double> angle_x, angle_y;     ///< field of view, radians
  CameraModel model = CameraModel::kPinhole;  ///< kPinhole with distortion is kOpenCv
  Distortion distortion;                      ///< with k4 of kPinhole and p1, p2 of kFisheye
  std::vector<double> fisheye624;             ///< twelve parameters where the model is FISHEYE624
  std::optional<double> crop_radius;          ///< pixels beyond which a fisheye shows nothing
  glm::dmat3 rotation{1.0};                   ///< world to camera, OpenCV axes
  glm::dvec3 translation{0.0};                ///< world to camera, OpenCV axes
};

/// A transforms.json of Blender / NeRF-synthetic, instant-ngp or nerfstudio.
struct TransformsFile {
  std::filesystem::path path;
  std::vector<TransformsFrame> frames;  ///< those to test (test_frames) behind the others
  std::string ply_file_path;            ///< sparse points, usually empty
  std::optional<std::vector<std::string>> train_filenames, val_filenames, test_filenames;
};

/// Numbers may be texts ("500"), matrices of 3 x 4, 4 x 4 or as many numbers in one list. Cameras
/// of NeuS2 (from_na) and Mitsuba (normal_mts_args) have axes of their own, which an info says.
/// Frames of test_frames (ScanNet++) count as those of test_filenames where the file has no lists;
/// those that are marked as is_bad are left out, which an info says. Throws DataError for malformed
/// JSON, camera models other than those of model_names() (instant-ngp: is_fisheye), k5 and k6 that
/// are not 0, and matrices that are not finite or, but for the lengths of their axes, no rigid
/// motion to 1e-3; smaller deviations are orthonormalised.
TransformsFile read_transforms(const std::filesystem::path& path);
/// The same of what is in memory; `path` names it in errors, and files lie beside it.
TransformsFile parse_transforms(const nlohmann::json& root, const std::filesystem::path& path);

/// What an object of another kind of file says of a camera by the keys of a frame; no pose and no
/// names. `where` says in errors, beside the path, whose it is. Throws as read_transforms() does.
TransformsFrame stated_intrinsics(const nlohmann::json& object,
                                  const std::filesystem::path& path,
                                  const std::string& where);

/// A name without root, "." and ".." components, so that files named after it stay inside their
/// folder.
std::string inner_name(const std::filesystem::path& path);

}  // namespace raysplats::io
