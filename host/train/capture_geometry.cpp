// SPDX-License-Identifier: Apache-2.0
#include "train/capture_geometry.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <glm/trigonometric.hpp>
#include <optional>
#include <utility>

#include "scene/camera/camera_model.hpp"
#include "scene/camera/orbit.hpp"
#include "scene/camera/view_axes.hpp"
#include "scene/even_choice.hpp"
#include "scene/statistics.hpp"
#include "util/parallel.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kLeastCameras = 8;  // of which one may be a stray
constexpr std::size_t kOneStrayIn = 20;
constexpr double kStrayFactor = 8.0;
constexpr std::size_t kMostAsking = 200;  // axes for their nearest one, which is sought among all
constexpr double kOnePlace = 1e-3;        // of what cameras see: nearer than this is no distance

glm::dvec3 mean_center(std::span<const Camera> cameras) {
  glm::dvec3 sum(0.0);
  for (const Camera& camera : cameras) sum += camera.center();
  return cameras.empty() ? sum : sum / static_cast<double>(cameras.size());
}

// How far from their mean the farthest of the cameras stands.
double radius_of(std::span<const Camera> cameras) {
  const glm::dvec3 center = mean_center(cameras);
  double radius = 0;
  for (const Camera& camera : cameras)
    radius = std::max(radius, glm::distance(camera.center(), center));
  return radius;
}

std::vector<Camera> usual(std::span<const Camera> cameras) {
  std::vector<Camera> out;
  for (const std::size_t i : usual_cameras(cameras)) out.push_back(cameras[i]);
  return out;
}

std::vector<glm::dvec3> axes_of(std::span<const Camera> cameras) {
  std::vector<glm::dvec3> out;
  out.reserve(cameras.size());
  for (const Camera& camera : cameras) out.push_back(view_axis(camera));
  return out;
}

// The median angle from an axis to the nearest one of `others`, radians. `own`: these are the axes
// themselves, of which each one looks for another.
double median_turn(const std::vector<glm::dvec3>& axes,
                   const std::vector<glm::dvec3>& others,
                   bool own) {
  std::vector<double> turns;
  for (const std::size_t i : even_choice(axes.size(), kMostAsking)) {
    double cosine = -1;
    for (std::size_t j = 0; j < others.size(); ++j) {
      if (!own || j != i) cosine = std::max(cosine, glm::dot(axes[i], others[j]));
    }
    turns.push_back(std::acos(std::min(cosine, 1.0)));
  }
  return median(std::move(turns));
}

// From its axis to the middle of the nearer side, radians.
double half_angle(const Camera& camera) {
  return std::atan(0.5 * std::min(camera.width / camera.fx, camera.height / camera.fy));
}

bool sees_far_around(const Camera& camera) {
  return camera.model == CameraModel::kEquirectangular || camera.model == CameraModel::kFisheye;
}

}  // namespace

std::vector<std::size_t> stray_cameras(std::span<const Camera> cameras) {
  if (cameras.size() < kLeastCameras) return {};
  glm::dvec3 middle;
  std::vector<double> values(cameras.size());
  for (int axis = 0; axis < 3; ++axis) {
    for (std::size_t i = 0; i < cameras.size(); ++i) values[i] = cameras[i].center()[axis];
    middle[axis] = median(values);
  }
  for (std::size_t i = 0; i < cameras.size(); ++i)
    values[i] = glm::distance(cameras[i].center(), middle);
  std::vector<double> sorted = values;
  std::sort(sorted.begin(), sorted.end());
  // Not interpolated: of a few cameras the stray one itself would count.
  const double reach = sorted[(cameras.size() - 1) * 9 / 10];
  if (reach <= 0) return {};
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    if (values[i] > kStrayFactor * reach) out.push_back(i);
  }
  if (out.size() > std::max<std::size_t>(1, cameras.size() / kOneStrayIn)) out.clear();
  return out;
}

std::vector<std::size_t> usual_cameras(std::span<const Camera> cameras) {
  const std::vector<std::size_t> strays = stray_cameras(cameras);
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    if (!std::binary_search(strays.begin(), strays.end(), i)) out.push_back(i);
  }
  return out;
}

double camera_extent(std::span<const Camera> cameras) {
  const double radius = radius_of(usual(cameras));
  return radius > 1e-6 ? 1.1 * radius : 1.0;
}

double scene_extent(std::span<const Camera> cameras, const PointCloud& points) {
  constexpr std::size_t kMostPoints = 10000;
  const double extent = camera_extent(cameras);
  const glm::dvec3 center = mean_center(usual(cameras));
  std::vector<double> distances;
  for (const std::size_t i : even_choice(points.size(), kMostPoints)) {
    const float* p = &points.positions[3 * i];
    const double distance = glm::distance(glm::dvec3(p[0], p[1], p[2]), center);
    if (std::isfinite(distance)) distances.push_back(distance);
  }
  if (distances.empty()) return extent;
  const double middle = median(std::move(distances));
  const bool one_place = cameras.size() < 2 || radius_of(usual(cameras)) < kOnePlace * middle;
  return one_place && middle > 0 ? middle : extent;
}

Region visible_region(std::span<const Camera> all, double extent) {
  const std::vector<Camera> cameras = usual(all);
  const Region around{mean_center(cameras), 3.0 * extent};
  const AxesFit fit = fit_axes(cameras);
  const auto count = static_cast<double>(cameras.size());
  // Parallel axes leave the depth open. The start needs it roughly, an orbit's middle does not bear
  // as much noise: common_target() gives up earlier.
  if (cameras.size() < 2 || std::abs(glm::determinant(fit.normal)) < 1e-4 * count * count * count)
    return around;
  const glm::dvec3 target = glm::inverse(fit.normal) * fit.right;
  std::vector<double> half_sides;
  for (const Camera& camera : cameras) {
    const double depth = glm::dot(target - camera.center(), view_axis(camera));
    // The axes of cameras in one place meet there.
    if (!(depth > kOnePlace * extent)) continue;
    // A panorama sees everything around it, parallel rays see as much at every depth.
    if (camera.model == CameraModel::kEquirectangular) return around;
    const double reach = camera.model == CameraModel::kOrthographic ? 1.0 : depth;
    half_sides.push_back(reach *
                         std::min(0.5 * camera.width / camera.fx, 0.5 * camera.height / camera.fy));
  }
  if (4 * half_sides.size() < 3 * cameras.size()) return around;
  const auto middle = half_sides.begin() + static_cast<std::ptrdiff_t>(half_sides.size() / 2);
  std::nth_element(half_sides.begin(), middle, half_sides.end());
  return {target, *middle};
}

std::optional<double> near_distance(std::span<const Camera> cameras,
                                    std::span<const float> points) {
  constexpr std::size_t kMostCameras = 50, kMostPoints = 20000;
  constexpr std::size_t kLeastSeen = 5;  // points; the nearest of few is near enough to a twentieth
  constexpr double kNearShare = 0.05;
  const std::vector<std::size_t> asked = even_choice(cameras.size(), kMostCameras);
  const std::vector<std::size_t> chosen = even_choice(points.size() / 3, kMostPoints);
  std::vector<double> nearest(asked.size(), 0.0);
  in_parallel(asked.size(), [&](std::size_t i) {
    const Camera& camera = cameras[asked[i]];
    if (camera.model == CameraModel::kOrthographic) return;  // which is at no distance
    std::vector<double> distances;
    for (const std::size_t k : chosen) {
      const glm::dvec3 point(points[3 * k], points[3 * k + 1], points[3 * k + 2]);
      if (project_into(camera, point)) distances.push_back(glm::distance(point, camera.center()));
    }
    if (distances.size() >= kLeastSeen)
      nearest[i] = quantiles(std::move(distances), std::array{kNearShare})[0];
  });
  std::erase(nearest, 0.0);
  if (nearest.empty() || 2 * nearest.size() < asked.size()) return std::nullopt;
  return median(std::move(nearest));
}

double motion_extent(std::span<const Camera> cameras, double extent, std::span<const float> means) {
  constexpr double kMostHalves = 5.0;  // usual lenses have 0.5 to 4.7
  constexpr double kMostNear = 1.5;    // captures of one subject have 0.4 to 1.8
  double out = std::min(extent, kMostHalves * visible_region(cameras, extent).half_side);
  if (const std::optional<double> near = near_distance(cameras, means))
    out = std::min(out, kMostNear * *near);
  return out;
}

bool look_elsewhere(std::span<const Camera> held_out, std::span<const Camera> trained) {
  constexpr std::size_t kLeastHeldOut = 3;
  constexpr double kLeastTurn = glm::radians(15.0);
  constexpr double kBeyond = 1.01;     // what neighbours see: crops that just meet do not miss any
  constexpr double kTimesUsual = 5.0;  // without rigs captures have up to 1.8
  if (held_out.size() < kLeastHeldOut || trained.size() < 2) return false;
  if (std::any_of(held_out.begin(), held_out.end(), sees_far_around) ||
      std::any_of(trained.begin(), trained.end(), sees_far_around))
    return false;
  const std::vector<glm::dvec3> axes = axes_of(trained);
  const double turn = median_turn(axes_of(held_out), axes, false);
  std::vector<double> halves;
  halves.reserve(trained.size());
  for (const Camera& camera : trained) halves.push_back(half_angle(camera));
  return turn > std::max(kLeastTurn, kBeyond * median(std::move(halves))) &&
         turn > kTimesUsual * median_turn(axes, axes, true);
}

double median_distance(std::span<const Camera> cameras, const glm::dvec3& point) {
  std::vector<double> distances;
  distances.reserve(cameras.size());
  for (const Camera& camera : cameras)
    distances.push_back(std::max(glm::distance(camera.center(), point), 1e-6));
  const auto middle = distances.begin() + static_cast<std::ptrdiff_t>(distances.size() / 2);
  std::nth_element(distances.begin(), middle, distances.end());
  return *middle;
}

double typical_depth(std::span<const Camera> cameras, const PointCloud& points) {
  const double extent = scene_extent(cameras, points);
  // Cameras in one place have no middle to be distant from.
  const double middle = median_distance(cameras, visible_region(cameras, extent).center);
  return middle > kOnePlace * extent ? middle : extent;
}

std::vector<double> subject_distances(std::span<const Camera> cameras,
                                      const PointCloud& points,
                                      double extent) {
  const std::optional<glm::dvec3> target = common_target(cameras);
  constexpr std::size_t kMostPoints = 4000;
  constexpr double kLeastDistance = 0.01;  // in extents
  const std::size_t stride = std::max<std::size_t>(1, points.size() / kMostPoints);
  std::vector<double> out;
  out.reserve(cameras.size());
  for (const Camera& camera : cameras) {
    const auto depth = [&](const glm::dvec3& point) {
      return (camera.rotation * point + camera.translation).z;
    };
    std::vector<double> depths;
    for (std::size_t i = 0; i < points.size(); i += stride) {
      const float* p = &points.positions[3 * i];
      const double z = depth({p[0], p[1], p[2]});
      if (z > kLeastDistance * extent) depths.push_back(z);
    }
    double distance = target ? depth(*target) : 0.0;
    if (!depths.empty()) distance = median(std::move(depths));
    out.push_back(distance > kLeastDistance * extent ? distance : extent);
  }
  return out;
}

double subject_length(std::span<const Camera> cameras, const PointCloud& points, double extent) {
  return std::max(extent, median(subject_distances(cameras, points, extent)));
}

}  // namespace raysplats
