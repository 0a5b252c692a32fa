// SPDX-License-Identifier: Apache-2.0
#include "scene/camera/camera_model.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat2x2.hpp>
#include <glm/matrix.hpp>
#include <numbers>
#include <vector>

#include "scene/camera/photo_lens.hpp"

namespace raysplats {
namespace {

constexpr double kPi = std::numbers::pi;
// Radius x/z of a kOpenCv lens: 89.94 degrees.
constexpr double kWidestRadius = 1000.0;

double widest(CameraModel model) { return model == CameraModel::kFisheye ? kPi : kWidestRadius; }

double evaluate(const std::vector<double>& coefficients, double s) {
  double value = 0;
  for (auto c = coefficients.rbegin(); c != coefficients.rend(); ++c) value = value * s + *c;
  return value;
}

/// Where in (0, limit) the polynomial changes its sign, in order: between two extrema at most once.
std::vector<double> sign_changes(const std::vector<double>& coefficients, double limit) {
  if (coefficients.size() < 2) return {};
  std::vector<double> derivative;
  for (std::size_t i = 1; i < coefficients.size(); ++i) {
    derivative.push_back(static_cast<double>(i) * coefficients[i]);
  }
  std::vector<double> knots = sign_changes(derivative, limit);
  knots.push_back(limit);
  std::vector<double> found;
  double begin = 0;
  for (const double end : knots) {
    double low = begin;
    double high = end;
    begin = end;
    const bool positive = evaluate(coefficients, low) > 0;
    if (positive == (evaluate(coefficients, high) > 0)) continue;
    for (double middle = 0.5 * (low + high); middle > low && middle < high;
         middle = 0.5 * (low + high)) {
      ((evaluate(coefficients, middle) > 0) == positive ? low : high) = middle;
    }
    found.push_back(low);
  }
  return found;
}

/// Factor of the radius: 1 + k1 r^2 + k2 r^4 + ... of both lenses.
std::array<double, 4> radial_terms(CameraModel model, const Distortion& d) {
  return {d.k1, d.k2, d.k3, model == CameraModel::kFisheye ? d.k4 : 0.0};
}

double radial_slope(CameraModel model, const Distortion& d, double r) {
  const std::array<double, 4> k = radial_terms(model, d);
  const double s = r * r;
  return 1 + s * (3 * k[0] + s * (5 * k[1] + s * (7 * k[2] + s * 9 * k[3])));
}

/// Whether a radius or angle is within lens_limit(). That takes the roots of a polynomial, and most
/// are so near to the axis that what its falling terms alone take off the slope leaves some.
bool within_limit(const Camera& camera, double r) {
  const std::array<double, 4> k = radial_terms(camera.model, camera.distortion);
  const double s = r * r;
  const double falling =
      s *
      (std::min(0.0, 3 * k[0]) +
       s * (std::min(0.0, 5 * k[1]) + s * (std::min(0.0, 7 * k[2]) + s * std::min(0.0, 9 * k[3]))));
  if (1 + falling > 0 && r < widest(camera.model)) return true;
  return r <= lens_limit(camera.model, camera.distortion);
}

/// Radius or angle in [0, limit] whose image radius is `image`; the nearer end when there is none.
double invert_radial(CameraModel model, const Distortion& d, double image, double limit) {
  double low = 0;
  double high = limit;
  double r = std::min(image, limit);
  for (int i = 0; i < 200; ++i) {
    const double residual = radial_image(model, d, r) - image;
    (residual > 0 ? high : low) = r;
    double next = r - residual / radial_slope(model, d, r);
    if (!(next >= low && next <= high)) next = 0.5 * (low + high);
    if (std::abs(next - r) <= 1e-16 * r) return next;
    r = next;
  }
  return r;
}

/// The undistorted point, or nothing.
std::optional<glm::dvec2> undistort(const Distortion& d, const glm::dvec2& target) {
  const double limit = lens_limit(CameraModel::kOpenCv, d);
  const double image = glm::length(target);
  if (image == 0 && d.p1 == 0 && d.p2 == 0) return glm::dvec2(0.0);
  // The tangential terms are small, so the radial solution is a start for both; on the fold of the
  // polynomial Newton's method could not leave.
  const double r = std::min(invert_radial(CameraModel::kOpenCv, d, image, limit), 0.999 * limit);
  glm::dvec2 p = image > 0 ? target * (r / image) : glm::dvec2(0.0);
  for (int i = 0; i < 50; ++i) {
    const glm::dvec2 residual = distort(d, p) - target;
    const double s = glm::dot(p, p);
    const double radial = 1 + s * (d.k1 + s * (d.k2 + s * d.k3));
    const double slope = 2 * (d.k1 + s * (2 * d.k2 + s * 3 * d.k3));
    const double mixed = slope * p.x * p.y + 2 * (d.p1 * p.x + d.p2 * p.y);
    const double xx = radial + slope * p.x * p.x + 2 * d.p1 * p.y + 6 * d.p2 * p.x;
    const double yy = radial + slope * p.y * p.y + 6 * d.p1 * p.y + 2 * d.p2 * p.x;
    const double determinant = xx * yy - mixed * mixed;
    p -= glm::dvec2(yy * residual.x - mixed * residual.y, xx * residual.y - mixed * residual.x) /
         determinant;
    if (glm::length(residual) <= 1e-15 * (1 + image)) break;
  }
  const bool solved = glm::length(distort(d, p) - target) <= 1e-9 * (1 + image);
  if (!solved || !(glm::length(p) <= limit)) return std::nullopt;
  return p;
}

}  // namespace

bool counts_along_ray(const Camera& camera) {
  return camera.model == CameraModel::kFisheye || camera.model == CameraModel::kEquirectangular ||
         (camera.lens && camera.lens->form == PhotoLens::Form::kFisheye);
}

double depth_of(const Camera& camera, const glm::dvec3& world) {
  const glm::dvec3 local = camera.rotation * world + camera.translation;
  return counts_along_ray(camera) ? glm::length(local) : local.z;
}

void set_equirectangular(Camera& camera) {
  camera.model = CameraModel::kEquirectangular;
  camera.fx = 0.5 * camera.width;
  camera.fy = camera.height;
  camera.cx = 0.5 * camera.width;
  camera.cy = 0.5 * camera.height;
}

glm::dvec2 distort(const Distortion& d, const glm::dvec2& p) {
  const double s = glm::dot(p, p);
  const double radial = 1 + s * (d.k1 + s * (d.k2 + s * d.k3));
  return {p.x * radial + 2 * d.p1 * p.x * p.y + d.p2 * (s + 2 * p.x * p.x),
          p.y * radial + d.p1 * (s + 2 * p.y * p.y) + 2 * d.p2 * p.x * p.y};
}

double radial_image(CameraModel model, const Distortion& d, double r) {
  const std::array<double, 4> k = radial_terms(model, d);
  const double s = r * r;
  return r * (1 + s * (k[0] + s * (k[1] + s * (k[2] + s * k[3]))));
}

double lens_limit(CameraModel model, const Distortion& d) {
  if (model != CameraModel::kOpenCv && model != CameraModel::kFisheye) return 0;
  const std::array<double, 4> k = radial_terms(model, d);
  const std::vector<double> stops =
      sign_changes({1, 3 * k[0], 5 * k[1], 7 * k[2], 9 * k[3]}, widest(model) * widest(model));
  return stops.empty() ? widest(model) : std::sqrt(stops.front());
}

CameraRay camera_ray(const Camera& camera, double px, double py) {
  CameraRay ray;
  glm::dvec3 direction(0, 0, 1);
  glm::dvec3 origin(0.0);
  const glm::dvec2 p((px - camera.cx) / camera.fx, (py - camera.cy) / camera.fy);
  switch (camera.model) {
    case CameraModel::kPinhole:
      direction = {p.x, p.y, 1.0};
      ray.valid = true;
      break;
    case CameraModel::kOpenCv: {
      const std::optional<glm::dvec2> found = undistort(camera.distortion, p);
      ray.valid = found.has_value();
      if (found) direction = {found->x, found->y, 1.0};
      break;
    }
    case CameraModel::kFisheye: {
      const double image = glm::length(p);
      const double limit = lens_limit(camera.model, camera.distortion);
      const double angle = invert_radial(camera.model, camera.distortion, image, limit);
      ray.valid = image <= radial_image(camera.model, camera.distortion, limit);
      const double sine = image > 0 ? std::sin(angle) / image : 1.0;
      if (ray.valid) direction = {sine * p.x, sine * p.y, std::cos(angle)};
      break;
    }
    case CameraModel::kEquirectangular: {
      const double longitude = 2 * kPi * (px / camera.width - 0.5);
      const double latitude = kPi * (0.5 - py / camera.height);
      direction = {std::sin(longitude) * std::cos(latitude), -std::sin(latitude),
                   std::cos(longitude) * std::cos(latitude)};
      ray.valid = py >= 0 && py <= camera.height;
      break;
    }
    case CameraModel::kOrthographic:
      origin = {p.x, p.y, 0.0};
      ray.valid = true;
      break;
    case CameraModel::kPhotoLens: {
      if (!camera.lens) break;
      const std::optional<glm::dvec3> found = lens_direction(*camera.lens, p);
      ray.valid = found.has_value();
      if (found) direction = *found;
      break;
    }
  }
  const glm::dmat3 to_world = glm::transpose(camera.rotation);
  ray.origin = to_world * (origin - camera.translation);
  ray.direction = glm::normalize(to_world * direction);
  return ray;
}

std::optional<glm::dvec2> project(const Camera& camera, const glm::dvec3& world) {
  const glm::dvec3 p = camera.rotation * world + camera.translation;
  const auto pixels = [&](const glm::dvec2& q) {
    return glm::dvec2(camera.fx * q.x + camera.cx, camera.fy * q.y + camera.cy);
  };
  // Of the models that need it: it takes longer than all of a pinhole.
  const auto across_axis = [&] { return std::hypot(p.x, p.y); };
  switch (camera.model) {
    case CameraModel::kPinhole:
      if (!(p.z > 0)) return std::nullopt;
      return pixels({p.x / p.z, p.y / p.z});
    case CameraModel::kOpenCv:
      if (!(p.z > 0) || !within_limit(camera, across_axis() / p.z)) return std::nullopt;
      return pixels(distort(camera.distortion, {p.x / p.z, p.y / p.z}));
    case CameraModel::kFisheye: {
      const double across = across_axis();
      const double angle = std::atan2(across, p.z);
      if (glm::length(p) == 0 || !within_limit(camera, angle)) return std::nullopt;
      if (across == 0) return pixels({0, 0});
      const double image = radial_image(camera.model, camera.distortion, angle);
      return pixels({p.x / across * image, p.y / across * image});
    }
    case CameraModel::kEquirectangular: {
      if (glm::length(p) == 0) return std::nullopt;
      return glm::dvec2(camera.width * (std::atan2(p.x, p.z) / (2 * kPi) + 0.5),
                        camera.height * (0.5 + std::atan2(p.y, std::hypot(p.x, p.z)) / kPi));
    }
    case CameraModel::kOrthographic:
      if (p.z < 0) return std::nullopt;
      return pixels({p.x, p.y});
    case CameraModel::kPhotoLens: {
      if (!camera.lens || glm::length(p) == 0) return std::nullopt;
      const std::optional<glm::dvec2> q = lens_point(*camera.lens, p);
      return q ? std::optional(pixels(*q)) : std::nullopt;
    }
  }
  return std::nullopt;
}

std::optional<glm::dvec2> project_into(const Camera& camera, const glm::dvec3& world) {
  const std::optional<glm::dvec2> point = project(camera, world);
  const bool inside = point && point->x >= 0 && point->x < camera.width && point->y >= 0 &&
                      point->y < camera.height;
  return inside ? point : std::nullopt;
}

}  // namespace raysplats
