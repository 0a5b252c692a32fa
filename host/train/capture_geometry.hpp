// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "raysplats/camera.hpp"
#include "raysplats/dataset.hpp"

namespace raysplats {

/// Numbers of the cameras that stand far outside of where nearly all others do: farther from the
/// median centre than eight times what 9 of 10 cameras keep. At most one in 20 (or a single one of
/// eight or more): beyond that they are no exceptions, and there are none.
std::vector<std::size_t> stray_cameras(std::span<const Camera> cameras);
/// Numbers of all others.
std::vector<std::size_t> usual_cameras(std::span<const Camera> cameras);

/// Radius of the camera centres about their mean, times 1.1, as in 3DGS, without the stray ones:
/// the length that learning rates and size thresholds are relative to. Never below a small positive
/// number.
double camera_extent(std::span<const Camera> cameras);

/// The same, but where the cameras stand in one place beside what they see (a tripod, a scanner's
/// station) the median distance of the points from there: the one length that is known then.
double scene_extent(std::span<const Camera> cameras, const PointCloud& points);

/// An axis-aligned cube, world units.
struct Region {
  glm::dvec3 center{0.0};
  double half_side = 1.0;
};

/// Where a random start puts its Gaussians. When most cameras look at a common point (the point
/// nearest to all view axes in the least-squares sense lies in front of at least 3 of 4 cameras) it
/// is the cube about that point that the median camera sees at the point's depth; otherwise the
/// cube of three scene extents about the mean camera centre. Stray cameras have no say.
Region visible_region(std::span<const Camera> cameras, double extent);

/// How near what the cameras see comes to them: the median over cameras of the distance that a
/// twentieth of the points in a picture (3 N numbers) are nearer than. Nothing where less than half
/// of the cameras see some. Of many cameras and points some, evenly spread, are looked at.
std::optional<double> near_distance(std::span<const Camera> cameras, std::span<const float> points);

/// What the learning rate of the means is relative to, of a model that begins at `means`: the least
/// of
/// * the scene extent;
/// * five times half of what the median camera sees across at the point that most look at, as
///   telephoto lenses stand far apart around something small, which steps by that would tear apart;
/// * one and a half times near_distance(): walks and flights go far past what is near them.
double motion_extent(std::span<const Camera> cameras, double extent, std::span<const float> means);

/// Whether the held-out cameras look where the trained ones do not, although these look where
/// others of them do: the median angle from a held-out axis to the nearest trained one is above 15
/// degrees, beyond what a trained camera sees, and above five times that from a trained axis to the
/// nearest other one. No for less than three held-out cameras, which may be odd ones, and where any
/// lens sees far beyond its axis (fisheyes, panoramas). Of many cameras some hundred, evenly
/// spread, are compared with all others.
bool look_elsewhere(std::span<const Camera> held_out, std::span<const Camera> trained);

/// Median of the distances from the point to the cameras, each at least 1e-6.
double median_distance(std::span<const Camera> cameras, const glm::dvec3& point);

/// How far away what the cameras look at is, as far as they and the points of the data set tell:
/// from the middle of their view, or the scene extent where they stand in it.
double typical_depth(std::span<const Camera> cameras, const PointCloud& points);

/// How far along its axis what a camera sees lies: the median depth of the points before it,
/// without points the depth of what all cameras look at (common_target()), else `extent`.
std::vector<double> subject_distances(std::span<const Camera> cameras,
                                      const PointCloud& points,
                                      double extent);

/// The median of these distances, at least `extent`: a length of what the cameras see, however near
/// to each other they stand.
double subject_length(std::span<const Camera> cameras, const PointCloud& points, double extent);

}  // namespace raysplats
