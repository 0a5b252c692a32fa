// SPDX-License-Identifier: Apache-2.0
#include "synth/shapes.hpp"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numbers>
#include <utility>

namespace raysplats::synth {

namespace {

constexpr double kPi = std::numbers::pi;

/// First t > 0 on a ball, kMiss without one; the ray may start inside.
double meet_sphere(const Ray& ray, const glm::dvec3& center, double radius) {
  const glm::dvec3 to_center = center - ray.origin;
  const double along = glm::dot(to_center, ray.direction);
  const glm::dvec3 off = to_center - along * ray.direction;
  const double discriminant = radius * radius - glm::dot(off, off);
  if (discriminant < 0.0) return kMiss;
  const double half = std::sqrt(discriminant);
  if (along - half > 0.0) return along - half;
  return along + half > 0.0 ? along + half : kMiss;
}

/// First t > 0 on the side of the cylinder that begins at `start` (without the ends).
double meet_rod(
    const Ray& ray, const glm::dvec3& start, const glm::dvec3& axis, double length, double radius) {
  const glm::dvec3 from = ray.origin - start;
  const double climb = glm::dot(ray.direction, axis);
  const double base = glm::dot(from, axis);
  const glm::dvec3 d = ray.direction - climb * axis;
  const glm::dvec3 o = from - base * axis;
  const double dd = glm::dot(d, d);
  if (dd < 1e-14) return kMiss;
  const double nearest = -glm::dot(o, d) / dd;
  const glm::dvec3 off = o + nearest * d;
  const double discriminant = radius * radius - glm::dot(off, off);
  if (discriminant < 0.0) return kMiss;
  const double half = std::sqrt(discriminant / dd);
  for (const double t : {nearest - half, nearest + half}) {
    const double height = base + t * climb;
    if (t > 0.0 && height >= 0.0 && height <= length) return t;
  }
  return kMiss;
}

/// The interval of the ray inside a box around the origin; empty when first >= second.
std::pair<double, double> clip_to_box(const Ray& ray, const glm::dvec3& half_extent) {
  double enter = 0.0;
  double leave = kMiss;
  for (int axis = 0; axis < 3; ++axis) {
    if (std::abs(ray.direction[axis]) < 1e-300) {
      if (std::abs(ray.origin[axis]) > half_extent[axis]) return {1.0, 0.0};
      continue;
    }
    const double inverse = 1.0 / ray.direction[axis];
    const double t0 = (-half_extent[axis] - ray.origin[axis]) * inverse;
    const double t1 = (half_extent[axis] - ray.origin[axis]) * inverse;
    enter = std::max(enter, std::min(t0, t1));
    leave = std::min(leave, std::max(t0, t1));
  }
  return {enter, leave};
}

double horizontal(const glm::dvec3& point) {
  return std::sqrt(point.x * point.x + point.y * point.y);
}

}  // namespace

glm::dvec3 Pose::to_local(const glm::dvec3& world) const {
  return (world - translation) * rotation;
}

Ray Pose::to_local(const Ray& ray) const {
  return {to_local(ray.origin), ray.direction * rotation};
}

glm::dmat3 frame_along(const glm::dvec3& axis) {
  const glm::dvec3 z = glm::normalize(axis);
  const glm::dvec3 other = std::abs(z.x) < 0.9 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
  const glm::dvec3 x = glm::normalize(other - glm::dot(other, z) * z);
  return {x, glm::cross(z, x), z};
}

double Sphere::intersect(const Ray& ray) const { return meet_sphere(ray, center_, radius_); }

glm::dvec3 Sphere::normal(const glm::dvec3& point) const { return (point - center_) / radius_; }

double Disc::intersect(const Ray& ray) const {
  double best = kMiss;
  for (const double z : {bottom_, top_}) {
    const double t = (z - ray.origin.z) / ray.direction.z;
    if (t > 0.0 && t < best && horizontal(ray.origin + t * ray.direction) <= radius_) best = t;
  }
  return std::min(best,
                  meet_rod(ray, {0.0, 0.0, bottom_}, {0.0, 0.0, 1.0}, top_ - bottom_, radius_));
}

glm::dvec3 Disc::normal(const glm::dvec3& point) const {
  if (std::abs(point.z - top_) < 1e-7) return {0.0, 0.0, 1.0};
  if (std::abs(point.z - bottom_) < 1e-7) return {0.0, 0.0, -1.0};
  return glm::normalize(glm::dvec3(point.x, point.y, 0.0));
}

double Disc::bound_radius() const { return std::hypot(radius_, 0.5 * (top_ - bottom_)); }

Wire::Wire(const std::vector<glm::dvec3>& points, double radius)
    : radius_(radius), end_(points.back()) {
  glm::dvec3 least = points.front();
  glm::dvec3 most = points.front();
  for (std::size_t i = 1; i < points.size(); ++i) {
    const glm::dvec3 way = points[i] - points[i - 1];
    segments_.push_back({points[i - 1], glm::normalize(way), glm::length(way)});
    least = glm::min(least, points[i]);
    most = glm::max(most, points[i]);
  }
  center_ = 0.5 * (least + most);
  half_extent_ = 0.5 * (most - least) + radius;
}

double Wire::bound_radius() const { return glm::length(half_extent_); }

double Wire::intersect(const Ray& ray) const {
  const auto [enter, leave] = clip_to_box({ray.origin - center_, ray.direction}, half_extent_);
  if (enter > leave) return kMiss;
  double best = meet_sphere(ray, end_, radius_);
  for (const Segment& segment : segments_) {
    best = std::min({best, meet_sphere(ray, segment.start, radius_),
                     meet_rod(ray, segment.start, segment.axis, segment.length, radius_)});
  }
  return best;
}

glm::dvec3 Wire::normal(const glm::dvec3& point) const {
  double best = kMiss;
  glm::dvec3 away(0.0, 0.0, 1.0);
  for (const Segment& segment : segments_) {
    const double along =
        std::clamp(glm::dot(point - segment.start, segment.axis), 0.0, segment.length);
    const glm::dvec3 offset = point - (segment.start + along * segment.axis);
    const double squared = glm::dot(offset, offset);
    if (squared < best) {
      best = squared;
      away = offset;
    }
  }
  return glm::normalize(away);
}

double Leaf::intersect(const Ray& ray) const {
  const Ray own = pose_.to_local(ray);
  const double t = -own.origin.z / own.direction.z;
  if (!(t > 0.0) || t == kMiss) return kMiss;
  const glm::dvec3 p = own.origin + t * own.direction;
  if (p.x <= 0.0 || p.x >= length_) return kMiss;
  const double half = 0.5 * width_ * std::pow(std::sin(kPi * p.x / length_), 0.8);
  return std::abs(p.y) < half ? t : kMiss;
}

glm::dvec3 Leaf::local(const glm::dvec3& point) const {
  const glm::dvec3 p = pose_.to_local(point);
  return {p.x / length_, 2.0 * p.y / width_, 0.0};
}

glm::dvec3 Leaf::bound_center() const {
  return pose_.translation + 0.5 * length_ * pose_.rotation[0];
}

double DistanceShape::intersect(const Ray& ray) const {
  constexpr int kMaxSteps = 192;
  constexpr double kTolerance = 1e-5;
  const Ray own = pose_.to_local(ray);
  auto [t, leave] = clip_to_box(own, half_extent_);
  for (int step = 0; step < kMaxSteps && t < leave; ++step) {
    const double d = distance(own.origin + t * own.direction);
    if (d < kTolerance) return t;
    t += d;
  }
  return kMiss;
}

glm::dvec3 DistanceShape::normal(const glm::dvec3& point) const {
  constexpr double kStep = 1e-5;
  const glm::dvec3 p = pose_.to_local(point);
  glm::dvec3 slope;
  for (int axis = 0; axis < 3; ++axis) {
    glm::dvec3 offset(0.0);
    offset[axis] = kStep;
    slope[axis] = distance(p + offset) - distance(p - offset);
  }
  return glm::normalize(pose_.rotation * slope);
}

double DistanceShape::bound_radius() const { return glm::length(half_extent_); }

Torus::Torus(const Pose& pose, double major, double minor)
    : DistanceShape(pose, glm::dvec3(major + minor, major + minor, minor) + 1e-4),
      major_(major),
      minor_(minor) {}

double Torus::distance(const glm::dvec3& point) const {
  const double ring = horizontal(point) - major_;
  return std::sqrt(ring * ring + point.z * point.z) - minor_;
}

// The largest outer radius is below 0.3 of the height: see outer_radius().
Vase::Vase(const glm::dvec3& center, double height)
    : DistanceShape({glm::dmat3(1.0), center},
                    glm::dvec3(0.3 * height, 0.3 * height, 0.5 * height) + 1e-4),
      height_(height) {}

double Vase::outer_radius(double z) const {
  const double u = std::clamp(z / height_ + 0.5, 0.0, 1.0);
  // Narrow foot, wide belly at a third of the height, neck, flared lip.
  return height_ * (0.17 + 0.10 * std::sin(kPi * (1.9 * u - 0.12)) + 0.07 * u * u * u - 0.02 * u);
}

double Vase::distance(const glm::dvec3& point) const {
  // |dr/dz| <= 0.10 * 1.9 pi + 0.19 < 0.8, so this factor turns the radial gap into a distance
  // bound.
  constexpr double kBound = 0.78;
  const double wall = 0.028 * height_;
  const double gap = kBound * (horizontal(point) - outer_radius(point.z));
  const double inside = std::max(gap + kBound * wall, wall - 0.5 * height_ - point.z);
  return std::max({gap, -inside, std::abs(point.z) - 0.5 * height_});
}

}  // namespace raysplats::synth
