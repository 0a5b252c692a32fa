// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <numbers>

#include "raysplats/error.hpp"
#include "scene/camera/camera_path.hpp"
#include "scene/camera/orbit.hpp"

namespace raysplats {
namespace {

constexpr int kTurns = 2;         // of a spiral
constexpr double kNearby = 0.9;   // of the photos within its width
constexpr double kForward = 0.7;  // of the mean of viewing directions
constexpr double kDepth = 0.5;    // of its width, how far it goes back and forth

void require(std::span<const Camera> photos, int frames, const char* option) {
  if (frames < 1) throw UsageError(fmt::format("{} {}: use 1 frame or more", option, frames));
  if (photos.size() < 2) {
    throw UsageError(fmt::format("{} follows the photos of --data, but there {} {}", option,
                                 photos.size() == 1 ? "is" : "are",
                                 photos.empty() ? "none" : "only one"));
  }
}

glm::dvec3 target_of(std::span<const Camera> photos, const char* option) {
  const std::optional<glm::dvec3> target = common_target(photos);
  if (!target) {
    throw UsageError(fmt::format(
        "{} turns around what the photos look at, and they look at no common point: use "
        "--interpolate",
        option));
  }
  return *target;
}

/// The lens of `lens` at `eye`, looking at `target`.
Camera placed(const Camera& lens,
              const glm::dvec3& eye,
              const glm::dvec3& target,
              const glm::dvec3& up,
              int frame) {
  Camera camera = lens;
  const Camera view = look_at(eye, target, up, lens.width, lens.height, lens.fx);
  camera.rotation = view.rotation;
  camera.translation = view.translation;
  camera.name = fmt::format("frame_{:04d}", frame);
  return camera;
}

}  // namespace

std::vector<Camera> ellipse_cameras(std::span<const Camera> photos, int frames) {
  require(photos, frames, "--ellipse");
  const glm::dvec3 target = target_of(photos, "--ellipse");
  const glm::dvec3 up = estimate_up(photos);
  glm::dvec3 middle(0.0);
  for (const Camera& photo : photos) middle += photo.center();
  middle /= static_cast<double>(photos.size());
  // Second moments in the plane across `up`; those of an ellipse are half its squared axes.
  const glm::dvec3 helper = std::abs(up.x) < 0.9 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
  const glm::dvec3 x = glm::normalize(helper - glm::dot(helper, up) * up);
  const glm::dvec3 y = glm::cross(up, x);
  double xx = 0, xy = 0, yy = 0;
  for (const Camera& photo : photos) {
    const glm::dvec3 arm = photo.center() - middle;
    xx += glm::dot(arm, x) * glm::dot(arm, x);
    xy += glm::dot(arm, x) * glm::dot(arm, y);
    yy += glm::dot(arm, y) * glm::dot(arm, y);
  }
  const double angle = 0.5 * std::atan2(2.0 * xy, xx - yy);
  const glm::dvec3 first = std::cos(angle) * x + std::sin(angle) * y;
  const glm::dvec3 second = glm::cross(up, first);
  const auto axis = [&](const glm::dvec3& direction) {
    double sum = 0;
    for (const Camera& photo : photos) {
      const double along = glm::dot(photo.center() - middle, direction);
      sum += along * along;
    }
    return std::sqrt(2.0 * sum / static_cast<double>(photos.size()));
  };
  const double a = axis(first);
  const double b = axis(second);
  std::vector<Camera> cameras;
  for (int i = 0; i < frames; ++i) {
    const double turn = 2.0 * std::numbers::pi * i / frames;
    const glm::dvec3 eye = middle + a * std::cos(turn) * first + b * std::sin(turn) * second;
    cameras.push_back(placed(photos.front(), eye, target, up, i));
  }
  return cameras;
}

std::vector<Camera> spiral_cameras(std::span<const Camera> photos, int frames) {
  require(photos, frames, "--spiral");
  glm::dvec3 up = estimate_up(photos);
  glm::dvec3 middle(0.0);
  glm::dvec3 forward(0.0);
  for (const Camera& photo : photos) {
    middle += photo.center();
    forward += glm::transpose(photo.rotation)[2];
  }
  middle /= static_cast<double>(photos.size());
  if (!(glm::length(forward) > kForward * static_cast<double>(photos.size()))) {
    throw UsageError(
        "--spiral needs photos that look the same way, and these look all around: use --ellipse "
        "or --interpolate");
  }
  forward = glm::normalize(forward);
  // Photos straight down whose ups cancel have none: then that of the first is kept.
  if (glm::length(glm::cross(up, forward)) < 1e-6) {
    const glm::dmat3 first = glm::transpose(photos.front().rotation);
    up = std::abs(glm::dot(first[1], forward)) < 0.9 ? -first[1] : first[0];
  }
  const glm::dvec3 right = glm::normalize(glm::cross(-up, forward));
  const glm::dvec3 down = glm::cross(forward, right);
  const auto width = [&](const glm::dvec3& axis) {
    std::vector<double> offsets;
    for (const Camera& photo : photos)
      offsets.push_back(std::abs(glm::dot(photo.center() - middle, axis)));
    std::sort(offsets.begin(), offsets.end());
    return offsets[static_cast<std::size_t>(kNearby * static_cast<double>(offsets.size() - 1))];
  };
  const double wide = width(right);
  const double high = width(down);
  // What is looked at lies ahead of the mean photo, as far as the photos' common point, or where
  // there is none far away in terms of the spiral.
  const double span = std::max({wide, high, 1e-6});
  double ahead = 10.0 * span;
  if (const auto common = common_target(photos)) {
    const double depth = glm::dot(*common - middle, forward);
    if (depth > span) ahead = depth;
  }
  const glm::dvec3 target = middle + ahead * forward;
  std::vector<Camera> cameras;
  for (int i = 0; i < frames; ++i) {
    const double turn = 2.0 * std::numbers::pi * kTurns * i / frames;
    const glm::dvec3 eye = middle + wide * std::cos(turn) * right + high * std::sin(turn) * down +
                           kDepth * span * std::sin(0.5 * turn) * forward;
    cameras.push_back(placed(photos.front(), eye, target, up, i));
  }
  return cameras;
}

std::vector<Camera> interpolated_cameras(std::span<const Camera> photos, int steps) {
  require(photos, steps, "--interpolate");
  CameraPath path;
  for (const Camera& photo : photos) path.keys.push_back(keyframe_of(photo));
  const int frames = static_cast<int>(photos.size() - 1) * steps + 1;
  std::vector<Camera> cameras;
  for (const Keyframe& view : path_views(path, frames)) {
    // The lens of the first photo, at the angle in between.
    const Camera& lens = photos.front();
    Camera camera = lens;
    const Camera pinhole = camera_of(view, lens.width, lens.height);
    camera.rotation = pinhole.rotation;
    camera.translation = pinhole.translation;
    if (lens.model == CameraModel::kPinhole) {
      camera.fx = lens.fx * pinhole.fy / lens.fy;
      camera.fy = pinhole.fy;
    }
    camera.name = fmt::format("frame_{:04d}", cameras.size());
    cameras.push_back(camera);
  }
  return cameras;
}

}  // namespace raysplats
