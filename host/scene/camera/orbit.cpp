// SPDX-License-Identifier: Apache-2.0
#include "scene/camera/orbit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <numbers>

#include "raysplats/error.hpp"
#include "scene/camera/camera_check.hpp"
#include "scene/camera/camera_model.hpp"
#include "scene/camera/view_axes.hpp"
#include "scene/gaussians/activation.hpp"
#include "scene/statistics.hpp"

namespace raysplats {
namespace {

constexpr double kRadians = std::numbers::pi / 180.0;

constexpr double kShown = 0.98;  // share of the opacity within the extent
constexpr double kReach = 2.0;   // standard deviations of a Gaussian that are to be seen
constexpr double kMargin = 1.05;
// Axes within about 10 degrees of each other: where they meet is lost in noise.
constexpr double kLeastSpread = 0.03;
constexpr double kMostBehind = 0.2;   // share of the cameras that may look away from their target
constexpr double kLeastCosine = 0.5;  // between axes of views that show the same sides of things
constexpr double kFarAway = 4.0;      // times the median: what reaches further is background
// Lengths of mean directions: photos straight down, taken on lines there and back.
constexpr double kCancelledUps = 0.5;
constexpr double kOneWay = 0.9;

void check(const OrbitOptions& options) {
  if (options.frames < 1) {
    throw UsageError(
        fmt::format("An orbit of {} frames is none: ask for at least one", options.frames));
  }
  if (options.width < 1 || options.height < 1) {
    throw UsageError(fmt::format("An image of {}x{} pixels is none: both sides must be at least 1",
                                 options.width, options.height));
  }
  if (options.model == CameraModel::kOpenCv) {
    throw UsageError(
        "An orbit has no lens with OpenCV distortion: take cameras with distortion from a file");
  }
  const double fov = options.fov_degrees;
  if (!(fov >= kLeastFov && fov <= most_fov(options.model))) {
    throw UsageError(
        fmt::format("A field of view of {} degrees makes no image: choose one from {} to {}", fov,
                    kLeastFov, most_fov(options.model)));
  }
  if (!(std::abs(options.elevation_degrees) < 90.0)) {
    throw UsageError(
        fmt::format("An orbit at {} degrees of elevation is a point: stay between -90 and 90",
                    options.elevation_degrees));
  }
  if (!(options.distance >= 0.0) || !std::isfinite(options.distance)) {
    throw UsageError(fmt::format("An orbit at distance {} has no eye: choose a positive number",
                                 options.distance));
  }
  check_up(options.up);
}

bool has_narrow_view(const Camera& camera) {
  return camera.model == CameraModel::kPinhole || camera.model == CameraModel::kOpenCv;
}

// Standard deviation of a Gaussian along a direction, the largest of its three for none; 0 for one
// that is not finite.
double deviation_along(const Gaussians& model, std::size_t i, const glm::dvec3& direction) {
  const float* q = &model.quaternions[4 * i];
  const glm::dquat rotation = glm::normalize(glm::dquat(q[0], q[1], q[2], q[3]));
  const double length = glm::length(direction);
  const glm::dvec3 local =
      length > 0.0 ? glm::inverse(rotation) * (direction / length) : glm::dvec3(1.0);
  double square = 0.0;
  double largest = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double scale = std::exp(static_cast<double>(model.log_scales[3 * i + k]));
    const double part = local[static_cast<int>(k)] * scale;
    square += part * part;
    largest = std::max(largest, scale);
  }
  const double deviation = length > 0.0 ? std::sqrt(square) : largest;
  return std::isfinite(deviation) ? deviation : 0.0;
}

}  // namespace

SceneExtent scene_extent(const Gaussians& model) {
  std::array<std::vector<double>, 3> axes;
  std::vector<double> weights;
  std::vector<std::size_t> indices;
  for (std::size_t i = 0; i < model.size(); ++i) {
    const float* mean = &model.means[3 * i];
    if (!std::isfinite(mean[0]) || !std::isfinite(mean[1]) || !std::isfinite(mean[2])) continue;
    const double opacity = sigmoid(static_cast<double>(model.opacities[i]));
    for (std::size_t k = 0; k < 3; ++k) axes[k].push_back(static_cast<double>(mean[k]));
    weights.push_back(std::isfinite(opacity) ? opacity : 0.0);
    indices.push_back(i);
  }
  SceneExtent extent;
  if (weights.empty()) return extent;
  extent.center = {weighted_quantile(axes[0], weights, 0.5),
                   weighted_quantile(axes[1], weights, 0.5),
                   weighted_quantile(axes[2], weights, 0.5)};
  std::vector<double> distances(weights.size());
  for (std::size_t i = 0; i < weights.size(); ++i) {
    const glm::dvec3 arm = glm::dvec3(axes[0][i], axes[1][i], axes[2][i]) - extent.center;
    distances[i] = glm::length(arm) + kReach * deviation_along(model, indices[i], arm);
  }
  const double middle = weighted_quantile(distances, weights, 0.5);
  const double most = weighted_quantile(distances, weights, kShown);
  const double far = weighted_quantile(distances, weights, 0.9);
  extent.radius = kMargin * (most <= kFarAway * middle ? most : std::min(far, 2.0 * middle));
  if (!(extent.radius > 0.0)) extent.radius = 1.0;
  return extent;
}

glm::dvec3 estimate_up(std::span<const Camera> cameras) {
  glm::dvec3 sum(0.0), ahead(0.0);
  for (const Camera& camera : cameras) {
    // Row 1 of world-to-camera is the camera's y axis in the world; it points down in the image.
    sum -= glm::transpose(camera.rotation) * glm::dvec3(0.0, 1.0, 0.0);
    ahead += view_axis(camera);
  }
  const auto count = static_cast<double>(cameras.size());
  const double length = glm::length(sum);
  const double forward = glm::length(ahead);
  // What is left of ups that cancel says which lines of a flight were longer, no more.
  if (length < kCancelledUps * count && forward > kOneWay * count) return -ahead / forward;
  return length > 1e-3 * count && std::isfinite(length) ? sum / length : glm::dvec3(0.0, -1.0, 0.0);
}

void check_up(const glm::dvec3& up) {
  const double length = glm::length(up);
  if (!(length > 0.0) || !std::isfinite(length)) {
    throw UsageError("The up direction has no length: give three numbers that are not all zero");
  }
}

double field_of_view(const Camera& camera, CameraModel as) {
  // Panoramas and parallel rays have no focal length.
  if (camera.model == CameraModel::kEquirectangular || camera.model == CameraModel::kOrthographic)
    return OrbitOptions().fov_degrees;
  const bool portrait = camera.width < camera.height;
  const double half = 0.5 * (portrait ? camera.width : camera.height);
  double angle = std::atan(half / (portrait ? camera.fx : camera.fy));
  if (camera.model == CameraModel::kFisheye && as == CameraModel::kFisheye) {
    const CameraRay axis = camera_ray(camera, camera.cx, camera.cy);
    const CameraRay side = camera_ray(camera, camera.cx + (portrait ? half : 0.0),
                                      camera.cy + (portrait ? 0.0 : half));
    angle = side.valid ? std::acos(std::clamp(glm::dot(axis.direction, side.direction), -1.0, 1.0))
                       : lens_limit(camera.model, camera.distortion);
  }
  return 2.0 * angle / kRadians;
}

std::optional<glm::dvec3> common_target(std::span<const Camera> cameras) {
  if (cameras.empty()) return std::nullopt;
  const AxesFit fit = fit_axes(cameras);
  const auto count = static_cast<double>(cameras.size());
  const glm::dmat3 inverse = glm::inverse(fit.normal);
  double norm = 0.0;
  for (int k = 0; k < 3; ++k) norm += glm::dot(inverse[k], inverse[k]);
  // The smallest eigenvalue of the mean, within a factor of the square root of 3; NaN fails too.
  if (!(1.0 / (std::sqrt(norm) * count) >= kLeastSpread)) return std::nullopt;
  const glm::dvec3 target = inverse * fit.right;
  double behind = 0.0;
  for (const Camera& camera : cameras) {
    if (!(glm::dot(target - camera.center(), view_axis(camera)) > 0.0)) ++behind;
  }
  if (behind >= kMostBehind * count) return std::nullopt;
  return target;
}

OrbitOptions orbit_like(std::span<const Camera> cameras,
                        const glm::dvec3& center,
                        OrbitOptions options) {
  if (cameras.empty()) return options;
  const glm::dvec3 up = glm::normalize(options.up);
  std::vector<double> distances;
  std::vector<double> elevations;
  for (const Camera& camera : cameras) {
    const glm::dvec3 arm = camera.center() - center;
    const double distance = glm::length(arm);
    if (!(distance > 0.0)) continue;
    distances.push_back(distance);
    elevations.push_back(std::asin(std::clamp(glm::dot(arm, up) / distance, -1.0, 1.0)) / kRadians);
  }
  if (distances.empty()) return options;
  options.distance = median(distances);
  options.elevation_degrees = std::clamp(median(elevations), -80.0, 80.0);
  return options;
}

std::size_t unseen_views(std::span<const Camera> cameras,
                         std::span<const Camera> photos,
                         double reach) {
  const auto vouches = [&](const Camera& photo, const Camera& camera) {
    if (glm::distance(photo.center(), camera.center()) > reach) return false;
    if (!has_narrow_view(photo) || !has_narrow_view(camera)) return true;
    return glm::dot(view_axis(photo), view_axis(camera)) >= kLeastCosine;
  };
  const auto unseen = std::count_if(cameras.begin(), cameras.end(), [&](const Camera& camera) {
    return std::none_of(photos.begin(), photos.end(),
                        [&](const Camera& photo) { return vouches(photo, camera); });
  });
  return static_cast<std::size_t>(unseen);
}

std::vector<Camera> orbit_cameras(const SceneExtent& extent, const OrbitOptions& options) {
  check(options);
  const glm::dvec3 up = glm::normalize(options.up);
  // Two axes that span the circle's plane; the world axis least parallel to `up` starts the
  // construction.
  const glm::dvec3 magnitude = glm::abs(up);
  glm::dvec3 helper(0.0);
  if (magnitude.x <= magnitude.y && magnitude.x <= magnitude.z) {
    helper.x = 1.0;
  } else if (magnitude.y <= magnitude.z) {
    helper.y = 1.0;
  } else {
    helper.z = 1.0;
  }
  const glm::dvec3 first = glm::normalize(helper - glm::dot(helper, up) * up);
  const glm::dvec3 second = glm::cross(up, first);

  const double half_fov = 0.5 * options.fov_degrees * kRadians;
  // A panorama, and a fisheye beyond 180 degrees, cannot be too near to see everything.
  const bool all_around =
      options.model == CameraModel::kEquirectangular || half_fov > 90.0 * kRadians;
  const double fitting = extent.radius / (all_around ? 1.0 : std::sin(half_fov));
  const double distance = options.distance > 0.0 ? options.distance : fitting;
  const double half_side = 0.5 * std::min(options.width, options.height);
  double focal = half_side / std::tan(half_fov);
  if (options.model == CameraModel::kFisheye) focal = half_side / half_fov;
  if (options.model == CameraModel::kOrthographic) focal /= distance;
  const double elevation = options.elevation_degrees * kRadians;
  std::vector<Camera> cameras;
  cameras.reserve(static_cast<std::size_t>(options.frames));
  for (int i = 0; i < options.frames; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / options.frames;
    const glm::dvec3 ring = std::cos(angle) * first + std::sin(angle) * second;
    const glm::dvec3 eye =
        extent.center + distance * (std::cos(elevation) * ring + std::sin(elevation) * up);
    cameras.push_back(look_at(eye, extent.center, up, options.width, options.height, focal));
    cameras.back().model = options.model;
    cameras.back().name = fmt::format("frame_{:04d}", i);
  }
  return cameras;
}

}  // namespace raysplats
