// SPDX-License-Identifier: Apache-2.0
#include "train/capture_geometry.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <optional>
#include <span>
#include <vector>

#include "unit/train/test_photos.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

Region region_of(std::span<const Camera> cameras) {
  return visible_region(cameras, camera_extent(cameras));
}

double motion_of(std::span<const Camera> cameras) {
  return motion_extent(cameras, camera_extent(cameras), {});
}

}  // namespace

TEST_CASE(
    "the region is the cube that inward cameras see, and surrounds cameras without a common "
    "target") {
  const glm::dvec3 target(3, -2, 1);
  const Region inward = region_of(ring(12, 4.0, target));
  CHECK(glm::distance(inward.center, target) < 1e-6);
  const double distance = 4.0 * std::sqrt(1 + 0.16);
  CHECK(inward.half_side == doctest::Approx(distance * 40.0 / 160.0));

  std::vector<Camera> parallel;
  for (int i = 0; i < 5; ++i) {
    parallel.push_back(look_at({i, 0, 0}, {static_cast<double>(i), 10, 0}, {0, 0, 1}, 80, 80, 80));
  }
  const Region along = region_of(parallel);
  CHECK(along.center.x == doctest::Approx(2.0));
  CHECK(along.half_side == doctest::Approx(3.0 * 1.1 * 2.0));

  std::vector<Camera> outward;
  for (const Camera& camera : ring(8, 4.0, target)) {
    outward.push_back(
        look_at(camera.center(), 2.0 * camera.center() - target, {0, 0, 1}, 80, 80, 80));
  }
  CHECK(region_of(outward).half_side == doctest::Approx(3.0 * camera_extent(outward)));
  CHECK(camera_extent(ring(12, 4.0, target)) == doctest::Approx(4.4));
  CHECK(camera_extent(std::vector<Camera>(1)) > 0);
}

TEST_CASE("means move by what cameras see where these stand far away, else by their spread") {
  const glm::dvec3 target(3, -2, 1);
  const std::vector<Camera> usual = ring(12, 4.0, target);
  CHECK(motion_of(usual) == camera_extent(usual));
  std::vector<Camera> telephoto = ring(12, 40.0, target);
  for (Camera& camera : telephoto) camera.fx = camera.fy = 10 * camera.fx;
  CHECK(motion_of(telephoto) == doctest::Approx(5 * region_of(usual).half_side));
  CHECK(camera_extent(telephoto) == doctest::Approx(44.0));
  // Without a common target the cameras do not say what they look at.
  for (Camera& camera : telephoto)
    camera.translation = -(camera.rotation * (2.0 * target - camera.center()));
  CHECK(motion_of(telephoto) == camera_extent(telephoto));
}

TEST_CASE("means move by what is near where cameras travel farther, in any unit") {
  for (const double unit : {1e-3, 1.0, 1e5}) {
    CAPTURE(unit);
    // A wall at the distance 4, dotted every 0.05 along and up, before which cameras walk by 100.
    std::vector<float> wall;
    for (int i = 0; i <= 2400; ++i) {
      for (int k = -5; k <= 5; ++k) {
        for (const double value : {0.05 * i - 10, 4.0, 0.2 * k})
          wall.push_back(static_cast<float>(unit * value));
      }
    }
    std::vector<Camera> walk;
    for (int i = 0; i <= 50; ++i) {
      const glm::dvec3 place(2.0 * unit * i, 0, 0);
      walk.push_back(look_at(place, place + glm::dvec3(0, 1, 0), {0, 0, 1}, 80, 80, 80));
    }
    const std::optional<double> near = near_distance(walk, wall);
    REQUIRE(near);
    CHECK(*near == doctest::Approx(4 * unit).epsilon(0.02));
    const double extent = camera_extent(walk);
    CHECK(extent == doctest::Approx(55 * unit));
    CHECK(motion_extent(walk, extent, wall) == doctest::Approx(1.5 * *near));
    // A twentieth of what is seen may be nearer, and what no picture shows does not count.
    std::vector<float> more = wall;
    for (int i = 0; i <= 2400; ++i) {
      for (const double value : {0.05 * i - 10, i % 5 == 0 ? 1.0 : -1.0, 0.0})
        more.push_back(static_cast<float>(unit * value));
    }
    CHECK(*near_distance(walk, more) == doctest::Approx(*near).epsilon(0.02));
    // Cameras that walk as far as the wall is away move means by what they walk.
    const std::vector<Camera> few(walk.begin(), walk.begin() + 4);
    CHECK(motion_extent(few, camera_extent(few), wall) == camera_extent(few));
    // Where most cameras see nothing, nothing is known.
    CHECK(!near_distance(walk, std::span(wall).first(wall.size() / 4)));
    CHECK(!near_distance(walk, {}));
    CHECK(!near_distance({}, wall));
  }
}

TEST_CASE("held-out cameras look elsewhere where counting holds out one lens of a rig") {
  const auto told = [](const std::vector<Camera>& cameras, std::size_t every) {
    std::vector<Camera> held_out, trained;
    for (std::size_t i = 0; i < cameras.size(); ++i)
      (i % every == 0 ? held_out : trained).push_back(cameras[i]);
    return look_elsewhere(held_out, trained);
  };
  const std::vector<Camera> rig = rig_of_eight(4);
  CHECK(told(rig, 8));
  CHECK_FALSE(told(rig, 9));
  CHECK_FALSE(told(rig, 5));
  // Every second lens, each 45 degrees from its neighbours.
  CHECK(told(rig, 2));
  CHECK(told(rig_of_eight(400), 8));
  // Lenses so wide that their neighbours see what a held-out one looks at.
  std::vector<Camera> overlapping = rig;
  for (Camera& camera : overlapping) camera.fx = camera.fy = 9;
  CHECK_FALSE(told(overlapping, 8));
  // Two held-out photos may be odd ones.
  CHECK_FALSE(told(rig_of_eight(2), 8));
  // Wherever its axis is, such a lens sees what the others do.
  for (const CameraModel model : {CameraModel::kFisheye, CameraModel::kEquirectangular}) {
    std::vector<Camera> wide = rig;
    wide[3].model = model;
    CHECK_FALSE(told(wide, 8));
  }
  // Captures of one camera, dense and sparse: all have their neighbours.
  for (const int count : {24, 32, 200}) CHECK_FALSE(told(ring(count, 4.0, {0, 0, 0}), 8));
}

TEST_CASE("cameras far from all others have no say in lengths, as long as they are exceptions") {
  const glm::dvec3 target(3, -2, 1);
  const std::vector<Camera> sound = ring(20, 4.0, target);
  CHECK(stray_cameras(sound).empty());
  std::vector<Camera> cameras = sound;
  cameras[7] = look_at({500, 80, 3}, target, {0, 0, 1}, 80, 100, 160);
  CHECK(stray_cameras(cameras) == std::vector<std::size_t>{7});
  CHECK(camera_extent(cameras) == doctest::Approx(camera_extent(sound)).epsilon(0.1));
  CHECK(glm::distance(region_of(cameras).center, target) < 1e-6);
  // A second one of twenty is a part of the capture, and so is one within the reach of others.
  cameras[8] = cameras[7];
  CHECK(stray_cameras(cameras).empty());
  CHECK(camera_extent(cameras) > 100);
  cameras = sound;
  cameras[7] = look_at(target + glm::dvec3(20, 0, 0), target, {0, 0, 1}, 80, 100, 160);
  CHECK(stray_cameras(cameras).empty());
  // Few cameras, or all but one in one place, leave nothing to compare with.
  CHECK(stray_cameras(std::vector<Camera>(cameras.begin(), cameras.begin() + 7)).empty());
  std::vector<Camera> tripod(12, cameras[0]);
  tripod.push_back(cameras[1]);
  CHECK(stray_cameras(tripod).empty());
}

TEST_CASE("cameras in one place count lengths by what they see, in any unit") {
  for (const double unit : {1e-3, 1.0, 1e3}) {
    CAPTURE(unit);
    PointCloud points;
    for (int i = 0; i < 60; ++i) {
      const double angle = 0.1 * i;
      for (const double value : {std::cos(angle), std::sin(angle), 0.0})
        points.positions.push_back(static_cast<float>(5 * unit * value));
    }
    // One point that is not finite and one far away say nothing.
    for (const float value : {NAN, 0.0f, 0.0f, 1e30f, 0.0f, 0.0f})
      points.positions.push_back(value);
    points.colors.resize(points.positions.size());
    std::vector<Camera> cameras;
    for (const double step : {0.0, 1e-4}) {
      CAPTURE(step);
      cameras.clear();
      for (int i = 0; i < 12; ++i) {
        const double angle = 0.1 * i;
        const glm::dvec3 center(step * unit * i, 0, 0);
        cameras.push_back(
            look_at(center, center + unit * glm::dvec3(std::cos(angle), std::sin(angle), 0.1 * i),
                    {0, 0, 1}, 80, 80, 80));
      }
      const double extent = scene_extent(cameras, points);
      CHECK(extent == doctest::Approx(5 * unit).epsilon(0.01));
      // Their axes meet where they stand, which is nothing that they look at.
      CHECK(motion_extent(cameras, extent, {}) == extent);
      CHECK(visible_region(cameras, extent).half_side == doctest::Approx(3 * extent));
    }
    CHECK(scene_extent(std::vector<Camera>{cameras[0]}, points) ==
          doctest::Approx(5 * unit).epsilon(0.01));
    // Without points nothing is known.
    CHECK(scene_extent(cameras, {}) == camera_extent(cameras));
    // Nor do points count where cameras stand apart.
    const std::vector<Camera> apart = ring(12, unit, {0, 0, 0});
    CHECK(scene_extent(apart, points) == camera_extent(apart));
  }
}
