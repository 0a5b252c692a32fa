// SPDX-License-Identifier: Apache-2.0
#include "train/start/pose_check.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "train/start/plane_sweep.hpp"
#include "unit/log_capture.hpp"
#include "unit/train/test_photos.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

// A ball of 1 around the world's origin, with a pattern, before black.
glm::dvec4 ball(const CameraRay& ray) {
  const double along = glm::dot(ray.origin, ray.direction);
  const double inside = along * along - glm::dot(ray.origin, ray.origin) + 1.0;
  if (inside < 0) return {0, 0, 0, 1};
  const glm::dvec3 p = ray.origin - (along + std::sqrt(inside)) * ray.direction;
  return {0.5 + 0.4 * std::sin(5.1 * p.y + 3.7 * p.z) * std::sin(4.3 * p.x),
          0.5 + 0.4 * std::cos(6.3 * p.z - 3.1 * p.y + p.x),
          0.5 + 0.4 * std::sin(7.7 * p.y - 2.9 * p.x), 1.0};
}

std::vector<SmallPhoto> photos_of_ball() {
  std::vector<SmallPhoto> out;
  for (const Camera& camera : ring(36, 3.0, {0, 0, 0})) out.push_back(photo_of(camera, ball));
  return out;
}

// The photos with the poses that a reader takes from files of the other convention.
std::vector<SmallPhoto> misread(std::vector<SmallPhoto> photos, PoseReading reading) {
  for (SmallPhoto& photo : photos) {
    if (reading == PoseReading::kInverseOtherAxes)
      photo.camera = read_as(photo.camera, PoseReading::kOtherAxes);
    photo.camera =
        read_as(photo.camera, reading == PoseReading::kOtherAxes ? PoseReading::kOtherAxes
                                                                 : PoseReading::kInverse);
  }
  return photos;
}

double agreed(const std::vector<SmallPhoto>& photos) {
  return probe_sweep(photos, depths_around(3.0), 5).agreed;
}

}  // namespace

TEST_CASE("poses in another convention are told by the photos, which agree in the right one") {
  const std::vector<SmallPhoto> photos = photos_of_ball();
  REQUIRE(agreed(photos) > 0.3);
  CHECK_FALSE(better_reading(photos, agreed(photos), 5));
  // However little agrees: none of the others is better.
  CHECK_FALSE(better_reading(photos, 0.12, 5));
  for (const PoseReading reading :
       {PoseReading::kOtherAxes, PoseReading::kInverse, PoseReading::kInverseOtherAxes}) {
    CAPTURE(static_cast<int>(reading));
    const std::vector<SmallPhoto> wrong = misread(photos, reading);
    const auto better = better_reading(wrong, agreed(wrong), 5);
    REQUIRE(better);
    CHECK(better->reading == reading);
    CHECK(better->agreed > 0.3);
  }
  CHECK_FALSE(better_reading({}, 0.0, 5));
}

TEST_CASE("a run is told how poses seem to be written, and how they should be") {
  const std::vector<SmallPhoto> photos = photos_of_ball();
  const auto said = [&](DatasetKind kind, PoseReading reading, const std::string& part) {
    Dataset dataset;
    dataset.kind = kind;
    const std::vector<SmallPhoto> wrong = misread(photos, reading);
    const LogCapture log;
    check_poses(dataset, wrong, agreed(wrong), 5);
    return log.contains(part);
  };
  const std::string opencv = "OpenCV's axes (y down, z forward)";
  const std::string opengl = "OpenGL's axes (y up, z backward)";
  CHECK(said(DatasetKind::kNerfstudio, PoseReading::kOtherAxes,
             "written as camera to world with " + opencv));
  CHECK(said(DatasetKind::kBlender, PoseReading::kInverse,
             "written as world to camera with " + opencv));
  CHECK(said(DatasetKind::kBlender, PoseReading::kInverseOtherAxes,
             "written as world to camera with " + opengl));
  CHECK(said(DatasetKind::kBlender, PoseReading::kInverseOtherAxes,
             "which have them camera to world with " + opengl));
  CHECK(said(DatasetKind::kColmap, PoseReading::kOtherAxes,
             "written as world to camera with " + opengl));
  CHECK(said(DatasetKind::kColmap, PoseReading::kInverse,
             "written as camera to world with " + opencv));
  CHECK(said(DatasetKind::kColmap, PoseReading::kInverseOtherAxes,
             "written as camera to world with " + opengl));
  CHECK(said(DatasetKind::kColmap, PoseReading::kInverse,
             "which have them world to camera with " + opencv));
  CHECK_FALSE(said(DatasetKind::kLlff, PoseReading::kInverse, "written as"));
}
