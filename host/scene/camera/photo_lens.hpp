// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <string>

#include "raysplats/camera.hpp"

namespace raysplats {

/// A lens that photos have been taken through and no rays go through here
/// (CameraModel::kPhotoLens): loading makes other pictures of such photos (rendered_camera()).
///
/// A direction at the angle t from the axis has the radius u = tan t (u = t for kFisheye) and the
/// image radius
///   kPerspective, kFisheye   u (1 + a1 u^2 + ... + a6 u^12) / (1 + b1 u^2 + b2 u^4 + b3 u^6)
///   kFov                     atan(2 u tan(w / 2)) / w            Devernay and Faugeras 2001
///   kDivision                2 u / (1 + sqrt(1 - 4 k u^2))       Fitzgibbon 2001
///   kEucm                    u / (a sqrt(b u^2 + 1) + 1 - a)     Khomutenko, Garcia, Martinet 2016
/// to which decentring (Brown 1966) and a thin prism (Weng, Cohen and Herniou 1992) are added:
///   x += 2 p1 x y + p2 (r^2 + 2 x^2) + s1 r^2 + s2 r^4
///   y += 2 p2 x y + p1 (r^2 + 2 y^2) + s3 r^2 + s4 r^4
struct PhotoLens {
  enum class Form { kPerspective, kFisheye, kFov, kDivision, kEucm };
  Form form = Form::kPerspective;
  std::array<double, 6> radial{};   ///< a1 to a6; w; k; a and b
  std::array<double, 3> divisor{};  ///< b1 to b3
  double p1 = 0, p2 = 0;
  std::array<double, 4> prism{};  ///< s1 to s4
  /// x and y of decentring and prism: after the radial factor (Project Aria's FISHEYE624), or
  /// before it (OpenCV, COLMAP's THIN_PRISM_FISHEYE).
  bool decentred_last = false;
  double radius = 0;  ///< image radius beyond which photos show nothing; 0: none
  double limit = 0;   ///< the largest angle that the lens is defined for, by measured()
};

/// The lens with its limit: where its image radius stops growing or reaches `radius`, at most pi
/// (kPerspective and kFov: 89.9 degrees), and within `widest` (image radius) before what is added
/// makes places be seen twice. Throws DataError, which begins with `what` ("the camera 3"), for
/// parameters that no lens has: an image that does not grow from its middle, and one in which
/// places are seen twice before nine tenths of these angles.
PhotoLens measured(PhotoLens lens, double widest, const std::string& what);

/// Distance of the farthest corner from the axis, in normalised image coordinates.
double image_reach(const Camera& camera);

/// Gives the camera, whose size and focal lengths are known, this lens, measured().
void set_photo_lens(Camera& camera, const PhotoLens& lens, const std::string& what);

/// FISHEYE624 of Project Aria, nerfstudio and COLMAP (RAD_TAN_THIN_PRISM_FISHEYE): six radial
/// coefficients, decentring p0 (along x) and p1, four of the prism.
PhotoLens fisheye624(std::span<const double, 12> parameters);

/// Where the lens maps a direction of the camera, in normalised image coordinates; nothing beyond
/// its limit.
std::optional<glm::dvec2> lens_point(const PhotoLens& lens, const glm::dvec3& direction);

/// The direction of unit length that lens_point() maps there, by Newton's method, or nothing.
std::optional<glm::dvec3> lens_direction(const PhotoLens& lens, const glm::dvec2& point);

/// The camera of the picture that loading makes of a photo: for kPhotoLens one of the same size in
/// the same place with a model that rays know, for others the camera itself. Lenses that map planes
/// become kPinhole with the same focal lengths, as kOpenCv does, where the farthest corner is
/// within 45 degrees of the axis; wider ones, and fisheyes, become kFisheye without distortion that
/// sees as much as the photo at its farthest corner.
Camera rendered_camera(const Camera& photo);

}  // namespace raysplats
