// SPDX-License-Identifier: Apache-2.0
#include "scene/camera/photo_lens.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

using Form = PhotoLens::Form;

constexpr double kPi = std::numbers::pi;
// A plane ends before a right angle: as kOpenCv's widest radius of 1000.
constexpr double kWidestPlane = 0.4994 * kPi;
// Half of the field of view up to which pinholes stretch corners to no more than twice their size.
constexpr double kWidestPinhole = 0.25 * kPi;

bool is_fisheye(const PhotoLens& lens) { return lens.form == Form::kFisheye; }

/// Image radius over radius, of the polynomial lenses.
double factor(const PhotoLens& lens, double s) {
  double above = 0, below = 0;
  for (auto a = lens.radial.rbegin(); a != lens.radial.rend(); ++a) above = (above + *a) * s;
  for (auto b = lens.divisor.rbegin(); b != lens.divisor.rend(); ++b) below = (below + *b) * s;
  return (1 + above) / (1 + below);
}

/// Image radius at the angle `t`, without what is added to it.
double radial_place(const PhotoLens& lens, double t) {
  const double across = std::sin(t), along = std::cos(t);
  switch (lens.form) {
    case Form::kPerspective:
      return across / along * factor(lens, across * across / (along * along));
    case Form::kFisheye:
      return t * factor(lens, t * t);
    case Form::kFov:
      return std::atan(2 * across / along * std::tan(0.5 * lens.radial[0])) / lens.radial[0];
    case Form::kDivision:
      return 2 * across / (along + std::sqrt(along * along - 4 * lens.radial[0] * across * across));
    case Form::kEucm:
      return across / (lens.radial[0] * std::hypot(std::sqrt(lens.radial[1]) * across, along) +
                       (1 - lens.radial[0]) * along);
  }
  return 0;
}

/// What is added at the place (x, y).
glm::dvec2 decentred(const PhotoLens& lens, const glm::dvec2& p) {
  const double r2 = glm::dot(p, p);
  const std::array<double, 4>& s = lens.prism;
  return {2 * lens.p1 * p.x * p.y + lens.p2 * (r2 + 2 * p.x * p.x) + r2 * (s[0] + s[1] * r2),
          2 * lens.p2 * p.x * p.y + lens.p1 * (r2 + 2 * p.y * p.y) + r2 * (s[2] + s[3] * r2)};
}

/// The image of the direction at the angle |p| from the axis towards p.
glm::dvec2 place(const PhotoLens& lens, const glm::dvec2& p) {
  const double t = glm::length(p);
  if (t == 0) return glm::dvec2(0.0);
  const glm::dvec2 towards = p / t;
  const glm::dvec2 image = towards * radial_place(lens, t);
  if (lens.decentred_last) return image + decentred(lens, image);
  return image + decentred(lens, towards * (is_fisheye(lens) ? t : std::tan(t)));
}

struct Slope {
  glm::dvec2 x, y;  ///< change of the image along the two angles
  double determinant() const { return x.x * y.y - x.y * y.x; }
};

Slope slope(const PhotoLens& lens, const glm::dvec2& p) {
  constexpr double kStep = 1e-5;
  const auto along = [&](const glm::dvec2& d) {
    return (place(lens, p + d) - place(lens, p - d)) / (2 * kStep);
  };
  return {along({kStep, 0}), along({0, kStep})};
}

/// The angle up to which the image radius grows.
double growing(const PhotoLens& lens) {
  const bool plane = lens.form == Form::kPerspective || lens.form == Form::kFov;
  const double widest = plane ? kWidestPlane : kPi;
  constexpr int kSteps = 8192;
  double before = 0;
  for (int i = 1; i <= kSteps; ++i) {
    const double here = radial_place(lens, widest * i / kSteps);
    // Written so that NaN does not grow.
    if (!(here > before && std::isfinite(here))) return widest * std::max(i - 2, 0) / kSteps;
    before = here;
  }
  return widest;
}

/// The angle whose image radius is `image`, or the limit where none is.
double angle_of(const PhotoLens& lens, double image) {
  double low = 0, high = lens.limit;
  for (int i = 0; i < 60; ++i) {
    const double middle = 0.5 * (low + high);
    (radial_place(lens, middle) < image ? low : high) = middle;
  }
  return 0.5 * (low + high);
}

/// Whether the image grows in every direction from the axis at the angle `t`.
bool grows_at(const PhotoLens& lens, double t) {
  constexpr int kWays = 32;
  for (int way = 0; way < kWays; ++way) {
    const double a = 2 * kPi * way / kWays;
    // Written so that NaN does not grow.
    if (!(slope(lens, {t * std::cos(a), t * std::sin(a)}).determinant() > 0)) return false;
  }
  return true;
}

/// The angle up to `end` within which no place of the image is seen twice: it ends before the first
/// ring on which the image turns over.
double single_until(const PhotoLens& lens, double end) {
  constexpr int kRings = 48;
  // On the fold itself Newton's method does not get near enough.
  constexpr double kBeforeFold = 0.995;
  double grows = 0;
  for (int ring = 0; ring <= kRings; ++ring) {
    const double here = std::max(end * ring / kRings, 1e-3);
    if (grows_at(lens, here)) {
      grows = here;
      continue;
    }
    double folds = here;
    for (int i = 0; i < 30; ++i) {
      const double middle = 0.5 * (grows + folds);
      (grows_at(lens, middle) ? grows : folds) = middle;
    }
    return kBeforeFold * grows;
  }
  return end;
}

void require_parameters(const PhotoLens& lens, const std::string& what) {
  const double a = lens.radial[0], b = lens.radial[1];
  if (lens.form == Form::kFov && !(std::abs(a) < kPi)) {
    throw DataError(fmt::format(
        "{} has a FOV lens with omega {:g}, which must lie between -pi and pi: correct it, or "
        "undistort the images first",
        what, a));
  }
  if (lens.form == Form::kEucm && !(a >= 0 && a <= 1 && b > 0)) {
    throw DataError(fmt::format(
        "{} has an EUCM lens with alpha {:g} and beta {:g}, which must be from 0 to 1 and above 0: "
        "correct them, or undistort the images first",
        what, a, b));
  }
}

}  // namespace

PhotoLens measured(PhotoLens lens, double widest, const std::string& what) {
  require_parameters(lens, what);
  // The sign is of no matter; of 0, as of what is smaller than any, a pinhole is left.
  if (lens.form == Form::kFov) lens.radial[0] = std::max(std::abs(lens.radial[0]), 1e-6);
  lens.limit = growing(lens);
  if (lens.radius > 0) lens.limit = angle_of(lens, lens.radius);
  constexpr double kLeast = 0.02;
  const double end = std::min(angle_of(lens, widest), lens.limit - 1e-4);
  // Where the radius stops growing, however little is added to it makes the image turn over in some
  // direction just before: there the lens ends. Nearer to the middle its parameters are wrong.
  constexpr double kLeastShare = 0.9;
  const double single = single_until(lens, end);
  if (single < end) lens.limit = single;
  if (!(lens.limit >= kLeast && single >= kLeastShare * end)) {
    throw DataError(
        fmt::format("{} has a lens that shows several directions in one place of the photo: "
                    "correct its distortion, or undistort the images first",
                    what));
  }
  return lens;
}

double image_reach(const Camera& camera) {
  return std::hypot(std::max(camera.cx, camera.width - camera.cx) / camera.fx,
                    std::max(camera.cy, camera.height - camera.cy) / camera.fy);
}

void set_photo_lens(Camera& camera, const PhotoLens& lens, const std::string& what) {
  camera.model = CameraModel::kPhotoLens;
  camera.lens = std::make_shared<const PhotoLens>(measured(lens, image_reach(camera), what));
}

PhotoLens fisheye624(std::span<const double, 12> p) {
  PhotoLens lens;
  lens.form = Form::kFisheye;
  std::copy_n(p.begin(), 6, lens.radial.begin());
  lens.p2 = p[6];
  lens.p1 = p[7];
  std::copy_n(p.begin() + 8, 4, lens.prism.begin());
  lens.decentred_last = true;
  return lens;
}

std::optional<glm::dvec2> lens_point(const PhotoLens& lens, const glm::dvec3& direction) {
  const double across = std::hypot(direction.x, direction.y);
  const double t = std::atan2(across, direction.z);
  if (!(t <= lens.limit)) return std::nullopt;
  if (across == 0) return glm::dvec2(0.0);
  return place(lens, glm::dvec2(direction.x, direction.y) * (t / across));
}

std::optional<glm::dvec3> lens_direction(const PhotoLens& lens, const glm::dvec2& point) {
  const double image = glm::length(point);
  // What is added is small, so that the radial solution is a start, a little before the fold.
  const double start = std::min(angle_of(lens, image), 0.99 * lens.limit);
  glm::dvec2 p = image > 0 ? point * (start / image) : glm::dvec2(0.0);
  glm::dvec2 residual = place(lens, p) - point;
  for (int i = 0; i < 50 && glm::length(residual) > 1e-14 * (1 + image); ++i) {
    const Slope s = slope(lens, p);
    const glm::dvec2 step = glm::dvec2(s.y.y * residual.x - s.y.x * residual.y,
                                       s.x.x * residual.y - s.x.y * residual.x) /
                            s.determinant();
    // Near a fold the whole step may lead away, or beyond the limit, where there is nothing.
    bool nearer = false;
    for (double share = 1; share > 1e-4 && !nearer; share *= 0.5) {
      const glm::dvec2 next = p - share * step, left = place(lens, next) - point;
      nearer = glm::length(next) <= lens.limit && glm::length(left) < glm::length(residual);
      if (!nearer) continue;
      p = next;
      residual = left;
    }
    if (!nearer) break;
  }
  if (!(glm::length(residual) <= 1e-9 * (1 + image))) return std::nullopt;
  const double t = glm::length(p);
  if (t == 0) return glm::dvec3(0, 0, 1);
  const glm::dvec2 across = p * (std::sin(t) / t);
  return glm::dvec3(across.x, across.y, std::cos(t));
}

Camera rendered_camera(const Camera& photo) {
  Camera out = photo;
  if (photo.model != CameraModel::kPhotoLens || !photo.lens) return out;
  const PhotoLens& lens = *photo.lens;
  out.lens = nullptr;
  const double corner = angle_of(lens, image_reach(photo));
  if (!is_fisheye(lens) && corner <= kWidestPinhole) {
    out.model = CameraModel::kPinhole;
    return out;
  }
  out.model = CameraModel::kFisheye;
  const double share = radial_place(lens, corner) / corner;
  out.fx *= share;
  out.fy *= share;
  return out;
}

}  // namespace raysplats
