// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "raysplats/camera.hpp"
#include "raysplats/gaussians.hpp"

namespace raysplats {

/// Where the matter of a model is: a centre and a radius that a few stray or distant Gaussians do
/// not move.
struct SceneExtent {
  glm::dvec3 center{0.0};
  double radius = 1.0;
};

/// Opacity-weighted median of the means, and the radius around it that holds 98 % of the weight,
/// each Gaussian with two standard deviations outwards, and a margin. Where that is more than four
/// times the median (backgrounds of outdoor captures reach hundreds of times further than the
/// subject), the radius of 90 %, at most twice the median. Gaussians that are not finite are left
/// out. An empty model gives the unit sphere.
SceneExtent scene_extent(const Gaussians& model);

/// The world direction that points up in most photos: the mean of the cameras' up axes. Where those
/// cancel it is away from what all look at, if all look one way (straight down, there and back),
/// else {0, -1, 0}, as without cameras: the y axis of COLMAP's and 3DGS' worlds points down.
glm::dvec3 estimate_up(std::span<const Camera> cameras);

/// Field of view along the smaller image side that a camera of the model `as` takes from this one,
/// in degrees: of a fisheye from a fisheye what its lens sees there, up to its limit, else that of
/// a pinhole with its focal length. From a panorama or parallel rays, which have none, the one that
/// orbits have without photos.
double field_of_view(const Camera& camera, CameraModel as);

/// Throws UsageError for a direction that is none.
void check_up(const glm::dvec3& up);

struct OrbitOptions {
  int frames = 60;
  int width = 800;
  int height = 800;
  double fov_degrees = 45.0;        ///< of the smaller image side
  double elevation_degrees = 20.0;  ///< of the eye above the plane through the centre
  double distance = 0.0;  ///< of the eye from the centre; 0 = the extent just fits the image
  glm::dvec3 up{0.0, -1.0, 0.0};
  /// Any but kOpenCv. kFisheye sees fov_degrees (up to 360) without distortion, kOrthographic what
  /// a pinhole sees of the plane through the centre, kEquirectangular everything.
  CameraModel model = CameraModel::kPinhole;
};

/// The point that photos look at: the nearest to their viewing axes in the mean square. None where
/// the axes do not meet (they are nearly parallel, or look away from each other as in a room that
/// was photographed from its middle: the point lies behind a fifth of the cameras or more).
std::optional<glm::dvec3> common_target(std::span<const Camera> cameras);

/// Distance and elevation at which photos were taken, for an orbit that stays where the model was
/// seen. Medians over the cameras relative to `center` and `up`; leaves `options` as they are
/// without cameras.
OrbitOptions orbit_like(std::span<const Camera> cameras,
                        const glm::dvec3& center,
                        OrbitOptions options);

/// How many of the cameras look from where no photo does: none within `reach` of their centres
/// looks within 60 degrees of where they look. What they show is a guess. Of wide lenses and
/// panoramas, and of photos and cameras through parallel rays, the place alone counts.
std::size_t unseen_views(std::span<const Camera> cameras,
                         std::span<const Camera> photos,
                         double reach);

/// Cameras on a full circle around `extent`, equally spaced, counter-clockwise seen from above, all
/// looking at the centre. Throws UsageError for sizes, counts, angles, models or directions that
/// make no camera.
std::vector<Camera> orbit_cameras(const SceneExtent& extent, const OrbitOptions& options);

}  // namespace raysplats
