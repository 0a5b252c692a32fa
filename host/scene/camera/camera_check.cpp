// SPDX-License-Identifier: Apache-2.0
#include "scene/camera/camera_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

// Single precision resolves 60 units there.
constexpr double kFarthest = 1e9;
constexpr double kMostDistortion = 1e3;
constexpr double kPi = 3.14159265358979323846;

// The largest term of the lens's polynomial at the corner that is farthest from the centre, in
// multiples of that distance.
double strongest_term(const Camera& camera) {
  const double x = std::max(std::abs(camera.cx), std::abs(camera.width - camera.cx)) / camera.fx;
  const double y = std::max(std::abs(camera.cy), std::abs(camera.height - camera.cy)) / camera.fy;
  double r = std::hypot(x, y);
  const Distortion& d = camera.distortion;
  const bool fisheye = camera.model == CameraModel::kFisheye;
  if (fisheye) r = std::min(r, kPi);
  double strongest = 0, power = 1;
  for (const double k : {d.k1, d.k2, d.k3, fisheye ? d.k4 : 0.0}) {
    power *= r * r;
    strongest = std::max(strongest, std::abs(k) * power);
  }
  if (!fisheye) strongest = std::max(strongest, 3 * r * (std::abs(d.p1) + std::abs(d.p2)));
  return strongest;
}

}  // namespace

bool is_rotation(const glm::dmat3& matrix, double tolerance) {
  for (int a = 0; a < 3; ++a) {
    for (int b = 0; b < 3; ++b) {
      const double off = glm::dot(matrix[a], matrix[b]) - (a == b ? 1.0 : 0.0);
      // Written so that NaN is off.
      if (!(std::abs(off) <= tolerance)) return false;
    }
  }
  return glm::determinant(matrix) > 0.0;
}

void require_pixels(const Camera& camera) {
  if (camera.model == CameraModel::kPhotoLens) {
    throw UsageError(fmt::format(
        "Camera '{}' has a lens that only photos have: give the camera of the view, not that of "
        "its photo",
        camera.name));
  }
  const bool focal = camera.model != CameraModel::kEquirectangular;
  if (camera.width < 1 || camera.height < 1 || (focal && (!(camera.fx > 0) || !(camera.fy > 0)))) {
    throw UsageError(fmt::format("Camera '{}' has no pixels or no focal length", camera.name));
  }
  const Distortion& d = camera.distortion;
  double sum = camera.cx + camera.cy + camera.fx + camera.fy;
  sum += d.k1 + d.k2 + d.k3 + d.k4 + d.p1 + d.p2;
  for (int k = 0; k < 3; ++k) {
    sum += camera.translation[k];
    for (int row = 0; row < 3; ++row) sum += camera.rotation[k][row];
  }
  if (!std::isfinite(sum)) {
    throw UsageError(fmt::format(
        "Camera '{}' has a pose or a lens that is not finite: correct its numbers", camera.name));
  }
  if (!is_rotation(camera.rotation)) {
    throw UsageError(fmt::format(
        "Camera '{}' has a rotation that scales, shears or mirrors: give rows of length 1 at right "
        "angles, with a determinant of 1",
        camera.name));
  }
}

void require_believable(const Camera& camera, const std::string& what) {
  const glm::dvec3 center = camera.center();
  // Written so that NaN is too far.
  if (!(glm::length(center) <= kFarthest)) {
    throw DataError(fmt::format(
        "{} is at ({:.3g}, {:.3g}, {:.3g}), more than {:g} from the origin: correct its pose or "
        "leave it out",
        what, center.x, center.y, center.z, kFarthest));
  }
  // measured() has made sure of a kPhotoLens.
  const bool has_lens =
      camera.model == CameraModel::kOpenCv || camera.model == CameraModel::kFisheye;
  if (!has_lens) return;
  if (const double strongest = strongest_term(camera); !(strongest <= kMostDistortion)) {
    const Distortion& d = camera.distortion;
    throw DataError(fmt::format(
        "{} has a lens (k1 {:g}, k2 {:g}, k3 {:g}, p1 {:g}, p2 {:g}, k4 {:g}) that moves corners "
        "of the picture to {:.2g} times their distance: correct its distortion or leave it out",
        what, d.k1, d.k2, d.k3, d.p1, d.p2, d.k4, strongest));
  }
}

}  // namespace raysplats
