// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "raysplats/camera.hpp"

namespace raysplats {

/// A view that a path goes through.
struct Keyframe {
  glm::dvec3 eye{0.0};
  glm::dmat3 axes{1.0};  ///< columns: right, down and forward in the world
  double fov = 50.0;     ///< degrees along the picture's height
  double seconds = 1.0;  ///< to the next one, in proportion
};

/// A way through keyframes: places on a centripetal Catmull-Rom curve (Yuksel, Schaefer and Keyser
/// 2011), orientations along the shortest turn (Shoemake 1985), angles of view in between.
struct CameraPath {
  std::vector<Keyframe> keys;   ///< at least one
  bool closed = false;          ///< goes on from the last to the first
  bool constant_speed = false;  ///< of the eye, whatever the seconds say
};

/// `frames` views of a path, at equal steps from its first keyframe to its last, or once around a
/// closed one, whose first view does not come again. Throws UsageError for a path without keyframes
/// and for less than one frame.
std::vector<Keyframe> path_views(const CameraPath& path, int frames);

/// The keyframe of a camera, and a pinhole camera of a keyframe.
Keyframe keyframe_of(const Camera& camera);
Camera camera_of(const Keyframe& key, int width, int height);

/// `from` with its pose a share of the way to that of `to`; below 0 and beyond 1 the pose goes on
/// as before. Between cameras of one model, size and distortion focal lengths and principal point
/// go along from 0 to 1, else they stay.
Camera between(const Camera& from, const Camera& to, double share);

/// Paths of `frames` views that follow photos, with the lens of the first photo. Throw UsageError
/// for less than two photos, and where the photos look at no common point but the path has to.
///
/// Once around the ellipse on which the photos lie in the mean, looking at what they look at.
std::vector<Camera> ellipse_cameras(std::span<const Camera> photos, int frames);
/// Two turns about the mean photo, as wide as nine of ten photos are away from it, while it goes
/// back and forth half as far (Mildenhall et al. 2019). UsageError where the photos look around.
std::vector<Camera> spiral_cameras(std::span<const Camera> photos, int frames);
/// From photo to photo in their order, `steps` views each, ending with the last one.
std::vector<Camera> interpolated_cameras(std::span<const Camera> photos, int steps);

}  // namespace raysplats
