// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <vector>

#include "io/dataset/data_option_table.hpp"
#include "raysplats/camera.hpp"
#include "raysplats/dataset.hpp"
#include "scene/camera/orbit.hpp"

namespace raysplats {

namespace io {
class TomlTable;
}

/// The [camera] of a scene file (docs/scene.md); what is not given has the default of its source.
struct SceneCamera {
  enum class Source {
    kNone,
    kPlaced,  ///< `position` and `target`
    kFile,    ///< a transforms.json
    kData,    ///< the views of a data set
    kGiven,   ///< `given`
    kOrbit,   ///< a circle around the scene; with `file` set, as the cameras of that data set
  };
  Source source = Source::kNone;
  std::string place;  ///< "FILE, line N" for messages
  std::optional<glm::dvec3> position, target, up;
  CameraModel model = CameraModel::kPinhole;
  Distortion distortion;
  std::optional<double> fov;     ///< degrees along the smaller side
  std::optional<double> focal;   ///< pixels
  std::optional<double> extent;  ///< world units along the smaller side (kOrthographic)
  std::optional<glm::dvec2> principal_point;  ///< pixels
  std::optional<int> width, height;
  std::filesystem::path file;  ///< of kFile, kData, and of kOrbit like a data set
  Split split = Split::kTest;
  DataSettings data_settings;      ///< that were given; of kFile the size of its pictures
  std::vector<std::size_t> views;  ///< of kFile and kData: these only; empty = all
  std::vector<Camera> given;       ///< of kGiven
  std::optional<int> frames;       ///< of kOrbit
  std::optional<double> elevation, distance;
};

/// Reads and checks the table [camera]. Throws UsageError and DataError with file and line.
SceneCamera read_scene_camera(io::TomlTable& table);

/// The cameras that `camera` means, in order; `frames` is the length of an orbit that states none,
/// `trained` what its settings for data sets go over. Cameras of files and given ones are in the
/// coordinates of the data set's files, and count from the origin of `trained` (none = 0)
/// afterwards. Throws UsageError where there is no camera or a value makes none, DataError for
/// files.
std::vector<Camera> scene_cameras(const SceneCamera& camera,
                                  const SceneExtent& extent,
                                  int frames,
                                  const DatasetOptions& trained);

/// The same view in another size: focal lengths follow the smaller side. With one number given, the
/// other keeps the shape of the picture.
Camera resized(const Camera& camera, std::optional<int> width, std::optional<int> height);

}  // namespace raysplats
