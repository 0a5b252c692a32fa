// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <string>

#include "raysplats/camera.hpp"
#include "scene/camera/orbit.hpp"

namespace raysplats::view {

/// What the page has to know before its first picture.
struct ViewState {
  std::string name;        ///< of the model
  std::string about;       ///< a line of facts
  SceneExtent extent;      ///< what is looked at
  glm::dvec3 origin{0.0};  ///< of the model, in the coordinates of the data set's files
  glm::dvec3 up{0, -1, 0};
  Camera start;                     ///< first view
  std::span<const Camera> cameras;  ///< of the data set
  float near_depth = 0.0f;
  bool has_near = false;  ///< whether a near limit can be asked for
  bool has_depth = false;
  bool has_order = false;      ///< whether the order of hits can be chosen
  bool has_background = true;  ///< whether another one can be chosen
  bool has_photos = false;     ///< whether there is /api/photo/N of the cameras
  bool takes_meshes = false;   ///< whether meshes can be dropped
  bool trains = false;         ///< whether there is /api/run
};

/// Where to begin: at the first camera, or on an orbit where there is none, looking at what most
/// cameras look at (`extent` where that is nothing), upright as they are or as `up` says. Refers to
/// `cameras`.
ViewState first_look(const SceneExtent& extent,
                     std::span<const Camera> cameras,
                     const std::optional<glm::dvec3>& up);

/// What cameras look at, before there is a model: their common target, or the middle between them
/// where they have none, out to the median camera.
SceneExtent extent_before(std::span<const Camera> cameras);

/// The JSON of /api/state: poses as view messages have them, in the model's coordinates, vertical
/// angles of view in degrees.
/// Bytes of names that are no UTF-8 are replaced.
std::string state_json(const ViewState& state);

}  // namespace raysplats::view
