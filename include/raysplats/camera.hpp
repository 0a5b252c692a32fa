// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <string>

namespace raysplats {

/// OpenCV lens distortion. For kOpenCv: r² = x² + y² in normalised image coordinates, k4 unused.
/// For kFisheye: polynomial k1..k4 of the angle (Kannala and Brandt 2006), p1 and p2 unused.
struct Distortion {
  double k1 = 0, k2 = 0, k3 = 0, p1 = 0, p2 = 0, k4 = 0;
  /// Whether there is any distortion.
  bool any() const { return k1 != 0 || k2 != 0 || k3 != 0 || k4 != 0 || p1 != 0 || p2 != 0; }
  bool operator==(const Distortion&) const = default;
};

/// A lens of kPhotoLens; its type is of the library itself.
struct PhotoLens;

/// How pixels become rays. Central cameras are traced in packets, through tiles on the faces of a
/// cube where they are no pinholes; kOrthographic ray by ray.
enum class CameraModel {
  kPinhole,          ///< no distortion
  kOpenCv,           ///< pinhole with radial and tangential distortion
  kFisheye,          ///< equidistant with a polynomial of the angle (KB4, OPENCV_FISHEYE)
  kEquirectangular,  ///< 360 degrees across, 180 down; fx, fy, cx, cy unused
  kOrthographic,     ///< parallel rays; fx and fy are pixels per world unit
  kPhotoLens,        ///< of photos on disk alone, which are made pictures of another model when
                     ///< they are loaded: lenses of COLMAP and nerfstudio that no ray knows
};

/// A camera with a pose. Camera axes are OpenCV's and COLMAP's: x right, y down, z forward;
/// the pixel (column i, row j) has its centre at (i + 0.5, j + 0.5).
struct Camera {
  std::string
      name;  ///< image name the view belongs to, with its folder, without meaning to the tracer
  int width = 0;                          ///< pixels
  int height = 0;                         ///< pixels
  double fx = 0, fy = 0, cx = 0, cy = 0;  ///< focal lengths and principal point, pixels
  glm::dmat3 rotation{1.0};               ///< world to camera
  glm::dvec3 translation{0.0};            ///< world to camera: x_cam = rotation * x + translation
  CameraModel model = CameraModel::kPinhole;
  Distortion distortion;                  ///< of kOpenCv and kFisheye
  std::shared_ptr<const PhotoLens> lens;  ///< of kPhotoLens, which is not without one

  /// Where the camera stands, world units.
  glm::dvec3 center() const { return -(glm::transpose(rotation) * translation); }
};

/// The camera of the same view for an image reduced by `factor` (a positive number; sizes round to
/// nearest). For every model: the field of view stays. Throws UsageError for other numbers, and for
/// sizes that an int does not hold.
Camera downscaled(const Camera& camera, double factor);

/// The camera turned about its own axes by the rotation vector `turn` (radians) and with its centre
/// moved by `shift` in the world.
Camera moved(const Camera& camera, const glm::dvec3& turn, const glm::dvec3& shift);

/// A camera at `eye` that looks at `target`; `up` is the world direction that points up in the
/// image (along the view any roll will do), `focal` the focal length in pixels. The principal point
/// is the middle of the picture. Throws UsageError where `eye` is `target`, or a number is not
/// finite.
Camera look_at(const glm::dvec3& eye,
               const glm::dvec3& target,
               const glm::dvec3& up,
               int width,
               int height,
               double focal);

}  // namespace raysplats
