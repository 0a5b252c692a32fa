// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "io/scene/scene_file.hpp"
#include "raysplats/camera.hpp"
#include "raysplats/scene.hpp"
#include "scene/camera/orbit.hpp"

namespace raysplats {

/// A scene file with everything it names, for any frame of its animation.
struct LoadedScene {
  Scene scene;                        ///< meshes where they are in frame 0
  SceneExtent extent;                 ///< of the Gaussians, of the meshes where there are none
  std::vector<Camera> cameras;        ///< one per frame, with the name of its picture
  std::vector<Mesh> still;            ///< meshes in the files' coordinates, in the scene's order
  std::vector<SceneMesh> placements;  ///< of `still`

  int frames() const { return static_cast<int>(cameras.size()); }
  /// Whether meshes differ between frames.
  bool moves() const;
  /// The meshes of a frame in the world: frame f of n is at time f / n of the animation, so that a
  /// full turn closes. What lies between two frames is a moment between them.
  std::vector<Mesh> meshes(double frame) const;
};

/// Loads models, meshes, textures and the environment, and works out the cameras. The animation has
/// as many frames as [animation] says, else as there are cameras; cameras are taken in turn.
/// Gaussians of all models are joined in Morton order. Without colour and picture the environment
/// is the background of the tracing options. Throws what the readers of the files throw, and
/// UsageError where the scene file does not fit them.
LoadedScene load_scene(const SceneFile& file);

}  // namespace raysplats
