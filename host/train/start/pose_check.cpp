// SPDX-License-Identifier: Apache-2.0
#include "train/start/pose_check.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <string>
#include <vector>

#include "train/capture_geometry.hpp"
#include "train/start/plane_sweep.hpp"

namespace raysplats {
namespace {

// In captures with sound poses, of all kinds, photos agree at 0.06 to 0.7 of what they show; in
// wrong readings of these at 0.1 at most, and at 0.36 of what they do in the right one.
constexpr double kLeastAgreed = 0.125;
constexpr double kClearlyBetter = 2.5;

// Half a turn about the x axis: from OpenGL's camera axes to OpenCV's and back.
const glm::dmat3 kOtherAxes{1, 0, 0, 0, -1, 0, 0, 0, -1};

// How matrices, or quaternions and vectors, of a file hold a pose.
struct Convention {
  bool to_world = true;      // camera to world
  bool opencv_axes = false;  // OpenCV's camera axes, else OpenGL's

  std::string text() const {
    return fmt::format(
        "{} with {}", to_world ? "camera to world" : "world to camera",
        opencv_axes ? "OpenCV's axes (y down, z forward)" : "OpenGL's axes (y up, z backward)");
  }
};

Convention written_as(DatasetKind kind, PoseReading reading) {
  const bool colmap = kind == DatasetKind::kColmap;
  const bool inverse = reading != PoseReading::kOtherAxes;
  // An inverse is of the axes that it is written with, whatever the reader takes them for.
  const bool opencv = reading == PoseReading::kInverse || (!colmap && !inverse);
  return {colmap == inverse, opencv};
}

}  // namespace

Camera read_as(Camera camera, PoseReading reading) {
  glm::dmat3 to_world = glm::transpose(camera.rotation);
  glm::dvec3 center = camera.center();
  if (reading != PoseReading::kOtherAxes) {
    to_world = camera.rotation;
    center = camera.translation;
  }
  if (reading != PoseReading::kInverse) to_world = to_world * kOtherAxes;
  camera.rotation = glm::transpose(to_world);
  camera.translation = -(camera.rotation * center);
  return camera;
}

std::optional<BetterReading> better_reading(std::span<const SmallPhoto> photos,
                                            double agreed,
                                            std::uint64_t seed) {
  if (photos.empty() || agreed >= kLeastAgreed) return std::nullopt;
  for (const PoseReading reading :
       {PoseReading::kOtherAxes, PoseReading::kInverse, PoseReading::kInverseOtherAxes}) {
    std::vector<SmallPhoto> read(photos.begin(), photos.end());
    std::vector<Camera> cameras;
    for (SmallPhoto& photo : read) {
      photo.camera = read_as(photo.camera, reading);
      cameras.push_back(photo.camera);
    }
    const DepthRange depths = swept_depths(read, typical_depth(cameras, {}), seed);
    const double share = probe_sweep(read, depths, seed).agreed;
    if (share >= kLeastAgreed && share >= kClearlyBetter * agreed)
      return BetterReading{reading, share};
  }
  return std::nullopt;
}

void check_poses(const Dataset& dataset,
                 std::span<const SmallPhoto> photos,
                 double agreed,
                 std::uint64_t seed) {
  spdlog::debug("{:.1f} % of what photos show agrees in one depth", 100 * agreed);
  // The axes of LLFF's files are others.
  if (dataset.kind == DatasetKind::kLlff) return;
  const auto better = better_reading(photos, agreed, seed);
  if (!better) return;
  const bool colmap = dataset.kind == DatasetKind::kColmap;
  spdlog::warn(
      "the poses of {} seem to be written as {}: so read, photos agree in one depth at {:.0f} % of "
      "what they show, and at {:.0f} % as files of its kind are read, which have them {}: convert "
      "them to that",
      dataset.root.string(), written_as(dataset.kind, better->reading).text(), 100 * better->agreed,
      100 * agreed, Convention{!colmap, colmap}.text());
}

}  // namespace raysplats
