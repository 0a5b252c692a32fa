// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "raysplats/camera.hpp"

namespace raysplats {

/// What goes over what the file says.
struct PathOptions {
  std::optional<double> seconds;
  std::optional<double> fps;
  std::optional<int> width, height;  ///< one alone keeps the shape
  bool constant_speed = false;
  std::filesystem::path transform;  ///< a dataparser_transforms.json, or empty
  /// The transforms.json of a model that was trained from one, whose applied_transform the other
  /// file has in it; empty for models in the coordinates of COLMAP.
  std::filesystem::path data_transform;
};

struct CameraPathFile {
  std::vector<Camera> cameras;  ///< frame by frame, named frame_0000 and so on
  double fps = 0;
  bool closed = false;
};

/// Reads a camera path of nerfstudio (JSON with "camera_path" or "keyframes", those as text by
/// columns included) or keyframes of our own (TOML with [[key]]; docs/cli.md). The frames of
/// "camera_path" are taken as they are unless `seconds` or another fps asks for other moments;
/// then they are keyframes themselves. `transform` takes the poses from nerfstudio's scaled world
/// back to that of the data. Throws DataError for files that are damaged or hold no path,
/// UsageError for TOML that says what cannot be, camera types other than perspective, fisheye and
/// equirectangular, and sizes or lengths out of range.
CameraPathFile read_camera_path(const std::filesystem::path& path, const PathOptions& options);

}  // namespace raysplats
