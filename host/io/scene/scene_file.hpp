// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <filesystem>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "io/scene/scene_camera.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/scene.hpp"
#include "raysplats/trace_options.hpp"
#include "scene/options/trace_option_table.hpp"

namespace raysplats {

/// How scene files place what they name: scaled, then turned about the fixed axes x, y and z in
/// this order (degrees), then moved.
glm::dmat4 scene_transform(const glm::dvec3& scale,
                           const glm::dvec3& rotate,
                           const glm::dvec3& translate);

/// [[model]]: Gaussians and where they are.
struct SceneModel {
  std::filesystem::path file;  ///< as read_model(), or the folder of a training run
  glm::dmat4 transform{1.0};
  /// From the scene's origin to its own (find_models()), before `transform`.
  glm::dvec3 offset{0.0};
  std::string place;  ///< "FILE, line N" for messages
};

/// [[mesh]]: triangles, where they are, and how they move over the animation.
struct SceneMesh {
  enum class Normals { kFile, kSmooth, kFlat };
  std::filesystem::path file;
  glm::dmat4 transform{1.0};
  std::string material;  ///< [[material]] of the whole mesh; empty = the file's own
  std::vector<std::pair<std::string, std::string>> materials;  ///< the file's name, [[material]]
  Normals normals = Normals::kFile;
  double crease_angle = 180.0;  ///< degrees; kSmooth keeps sharper edges
  glm::dvec3 move{0.0};         ///< way over the whole animation, world units
  glm::dvec3 turn_axis{0.0, 1.0, 0.0};
  double turn_degrees = 0.0;        ///< over the whole animation
  std::optional<glm::dvec3> pivot;  ///< of the turn, world; none = where the mesh's origin is
  std::string place;

  bool moves() const { return move != glm::dvec3(0.0) || turn_degrees != 0.0; }
  /// From the file's coordinates to the world at `time`, 0 to 1.
  glm::dmat4 placement(double time) const;
};

/// [[material]] with the file of its texture.
struct SceneMaterial {
  Material material;
  std::filesystem::path texture;
  std::string place;
};

/// [environment]: what is not given is the background that the models were trained with.
struct SceneEnvironment {
  std::optional<Rgb> color;
  std::filesystem::path image;
  float exposure = 0.0f;         ///< stops
  std::optional<glm::dvec3> up;  ///< none = the camera's
  float rotation = 0.0f;
};

/// What a scene.toml says (docs/scene.md), checked but not loaded.
struct SceneFile {
  std::filesystem::path path;
  std::vector<SceneModel> models;
  std::vector<SceneMesh> meshes;
  std::vector<SceneMaterial> materials;
  std::vector<Light> lights;
  SceneEnvironment environment;
  SceneCamera camera;
  RenderSettings render;
  TraceSettings trace;   ///< that were given; the others are as the models were trained
  TraceOptions trained;  ///< what `trace` goes over
  /// What the settings of [camera] for data sets go over. Its origin is where positions of the
  /// scene count from in the coordinates of files with cameras.
  DatasetOptions trained_data{.origin = std::array<double, 3>{}};
  std::optional<int> frames;  ///< [animation]
  /// Size of the pictures whatever the camera says, then divided by `downscale`.
  std::optional<int> width, height;
  double downscale = 1.0;
};

/// Whether it is a scene file that is named, and no model: by its ending, .toml.
bool is_scene_file(const std::filesystem::path& path);

/// Reads a scene file. Throws UsageError for unknown keys (with the nearest known one), wrong
/// types, values out of range and scenes with neither model nor mesh, DataError for files that are
/// not there; all with file and line.
SceneFile read_scene_file(const std::filesystem::path& path);

}  // namespace raysplats
