// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <vector>

namespace raysplats::synth {

/// A half-line; `direction` has length 1.
struct Ray {
  glm::dvec3 origin;
  glm::dvec3 direction;
};

constexpr double kMiss = std::numeric_limits<double>::infinity();

/// Position and orientation of a shape: world = rotation * local + translation.
struct Pose {
  glm::dmat3 rotation{1.0};
  glm::dvec3 translation{0.0};

  glm::dvec3 to_local(const glm::dvec3& world) const;
  Ray to_local(const Ray& ray) const;
};

/// A rotation that turns the local Z axis to `axis`.
glm::dmat3 frame_along(const glm::dvec3& axis);

/// A surface that rays meet.
class Shape {
 public:
  virtual ~Shape() = default;
  /// Distance along the ray of the first point with t > 0; kMiss when there is none.
  virtual double intersect(const Ray& ray) const = 0;
  /// Unit normal at a point of the surface; thin plates return either side.
  virtual glm::dvec3 normal(const glm::dvec3& point) const = 0;
  /// The point in the coordinates that textures use.
  virtual glm::dvec3 local(const glm::dvec3& point) const = 0;
  /// A ball that contains the shape.
  virtual glm::dvec3 bound_center() const = 0;
  virtual double bound_radius() const = 0;
};

class Sphere final : public Shape {
 public:
  Sphere(const glm::dvec3& center, double radius) : center_(center), radius_(radius) {}
  double intersect(const Ray& ray) const override;
  glm::dvec3 normal(const glm::dvec3& point) const override;
  glm::dvec3 local(const glm::dvec3& point) const override { return point - center_; }
  glm::dvec3 bound_center() const override { return center_; }
  double bound_radius() const override { return radius_; }

 private:
  glm::dvec3 center_;
  double radius_;
};

/// A flat upright cylinder with its caps, for a table top.
class Disc final : public Shape {
 public:
  Disc(double radius, double bottom, double top) : radius_(radius), bottom_(bottom), top_(top) {}
  double intersect(const Ray& ray) const override;
  glm::dvec3 normal(const glm::dvec3& point) const override;
  glm::dvec3 local(const glm::dvec3& point) const override { return point; }
  glm::dvec3 bound_center() const override { return {0.0, 0.0, 0.5 * (bottom_ + top_)}; }
  double bound_radius() const override;

 private:
  double radius_, bottom_, top_;
};

/// A chain of round rods through `points`, with spherical joints and ends.
class Wire final : public Shape {
 public:
  Wire(const std::vector<glm::dvec3>& points, double radius);
  double intersect(const Ray& ray) const override;
  glm::dvec3 normal(const glm::dvec3& point) const override;
  glm::dvec3 local(const glm::dvec3& point) const override { return point; }
  glm::dvec3 bound_center() const override { return center_; }
  double bound_radius() const override;

 private:
  struct Segment {
    glm::dvec3 start;
    glm::dvec3 axis;  ///< unit
    double length;
  };
  std::vector<Segment> segments_;
  double radius_;
  glm::dvec3 end_;
  glm::dvec3 center_;       ///< of the box around the wire
  glm::dvec3 half_extent_;  ///< of the box around the wire
};

/// A plate without thickness in the local XY plane with a pointed oval outline:
/// |y| < width/2 * sin(pi x / length)^0.8 for 0 < x < length.
class Leaf final : public Shape {
 public:
  Leaf(const Pose& pose, double length, double width)
      : pose_(pose), length_(length), width_(width) {}
  double intersect(const Ray& ray) const override;
  glm::dvec3 normal(const glm::dvec3&) const override { return pose_.rotation[2]; }
  /// x in [0, 1] along the leaf, y in [-1, 1] across it.
  glm::dvec3 local(const glm::dvec3& point) const override;
  glm::dvec3 bound_center() const override;
  double bound_radius() const override { return 0.5 * (length_ + width_); }

 private:
  Pose pose_;
  double length_, width_;
};

/// A surface given by a signed distance bound, found by sphere tracing (Hart 1996) within a local
/// box.
class DistanceShape : public Shape {
 public:
  DistanceShape(const Pose& pose, const glm::dvec3& half_extent)
      : pose_(pose), half_extent_(half_extent) {}
  double intersect(const Ray& ray) const final;
  glm::dvec3 normal(const glm::dvec3& point) const final;
  glm::dvec3 local(const glm::dvec3& point) const final { return pose_.to_local(point); }
  glm::dvec3 bound_center() const final { return pose_.translation; }
  double bound_radius() const final;

 protected:
  /// A lower bound of the distance to the surface with the sign of the side (negative inside).
  virtual double distance(const glm::dvec3& point) const = 0;

 private:
  Pose pose_;
  glm::dvec3 half_extent_;
};

/// Torus around the local Z axis.
class Torus final : public DistanceShape {
 public:
  Torus(const Pose& pose, double major, double minor);

 private:
  double distance(const glm::dvec3& point) const override;
  double major_, minor_;
};

/// A hollow, open vase around the local Z axis between z = -height/2 and height/2.
class Vase final : public DistanceShape {
 public:
  Vase(const glm::dvec3& center, double height);

 private:
  double distance(const glm::dvec3& point) const override;
  double outer_radius(double z) const;
  double height_;
};

}  // namespace raysplats::synth
