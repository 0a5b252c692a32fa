// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>

#include "raysplats/camera.hpp"

namespace raysplats {

/// What a point of the image sees.
struct CameraRay {
  glm::dvec3 origin{0.0};         ///< world
  glm::dvec3 direction{0, 0, 1};  ///< world, unit length
  bool valid = false;             ///< false where the lens sees nothing
};

/// The ray through the image point (px, py) in pixels, in double precision, for every model.
/// Distortion is inverted by Newton's method. A point sees nothing where no ray maps to it within
/// lens_limit(), and above or below an equirectangular picture.
/// Sources: Brown 1966 as in OpenCV (kOpenCv), Kannala and Brandt 2006 as in OpenCV's fisheye
/// module (kFisheye). kEquirectangular: columns are longitude (the centre looks along z, to the
/// right is x), rows latitude (the top row is up, -y). kOrthographic: rays along z that start on
/// the plane z = 0.
CameraRay camera_ray(const Camera& camera, double px, double py);

/// The image point at which a world point is seen, possibly outside the picture; nothing where the
/// camera cannot see it at all (behind a pinhole, beyond lens_limit(), at the very centre).
std::optional<glm::dvec2> project(const Camera& camera, const glm::dvec3& world);
/// The same where it lies in the picture; nothing elsewhere.
std::optional<glm::dvec2> project_into(const Camera& camera, const glm::dvec3& world);

/// Whether depths of this camera are counted along the ray (fisheyes and panoramas), not along its
/// axis.
bool counts_along_ray(const Camera& camera);
/// How deep it sees a world point.
double depth_of(const Camera& camera, const glm::dvec3& world);

/// Makes the camera a panorama with the intrinsics that nerfstudio gives one.
void set_equirectangular(Camera& camera);

/// Where a kOpenCv lens maps the normalised image point.
glm::dvec2 distort(const Distortion& distortion, const glm::dvec2& point);

/// How far from its axis a lens is defined: the largest radius x/z (kOpenCv, at most 1000) or angle
/// in radians (kFisheye, at most pi) up to which its radial polynomial grows. 0 for other models.
double lens_limit(CameraModel model, const Distortion& distortion);

/// Image radius of a point at radius or angle `r` from the axis, without tangential terms, in
/// normalised image coordinates.
double radial_image(CameraModel model, const Distortion& distortion, double r);

}  // namespace raysplats
