// SPDX-License-Identifier: Apache-2.0
#include "scene/camera/camera_path.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <numbers>

#include "raysplats/error.hpp"

using namespace raysplats;

namespace {

Keyframe key_at(const glm::dvec3& eye, const glm::dvec3& target, double fov = 50) {
  Keyframe key;
  key.eye = eye;
  key.axes = glm::transpose(look_at(eye, target, {0, -1, 0}, 1, 1, 1.0).rotation);
  key.fov = fov;
  return key;
}

CameraPath square(bool closed) {
  CameraPath path;
  path.closed = closed;
  for (const glm::dvec3 eye :
       {glm::dvec3(2, 0, 0), glm::dvec3(0, 0, 2), glm::dvec3(-2, 0, 0), glm::dvec3(0, 0, -2)}) {
    path.keys.push_back(key_at(eye, {0, 0.5, 0}, 40 + eye.x));
  }
  return path;
}

double off(const glm::dmat3& a, const glm::dmat3& b) {
  double most = 0;
  for (int i = 0; i < 3; ++i) most = std::max(most, glm::distance(a[i], b[i]));
  return most;
}

std::vector<Camera> ring(int count, double a, double b) {
  std::vector<Camera> cameras;
  for (int i = 0; i < count; ++i) {
    const double turn = 2 * std::numbers::pi * i / count;
    cameras.push_back(
        look_at({a * std::cos(turn), -1, b * std::sin(turn)}, {0, 0, 0}, {0, -1, 0}, 64, 48, 60));
  }
  return cameras;
}

}  // namespace

TEST_CASE("a path goes through its keyframes, straight on where they lie on a line") {
  for (const bool closed : {false, true}) {
    CAPTURE(closed);
    const CameraPath path = square(closed);
    const int spans = closed ? 4 : 3;
    const auto views = path_views(path, closed ? 40 : 31);
    REQUIRE(views.size() == (closed ? 40u : 31u));
    for (int i = 0; i <= spans - (closed ? 1 : 0); ++i) {
      const Keyframe& key = path.keys[static_cast<std::size_t>(i)];
      const Keyframe& view = views[static_cast<std::size_t>(10 * i)];
      CHECK(glm::distance(view.eye, key.eye) < 1e-9);
      CHECK(off(view.axes, key.axes) < 1e-9);
      CHECK(view.fov == doctest::Approx(key.fov));
    }
    // Smooth: no step is much longer than its neighbour, and axes stay a rotation.
    for (std::size_t i = 2; i < views.size(); ++i) {
      const double before = glm::distance(views[i - 2].eye, views[i - 1].eye);
      const double now = glm::distance(views[i - 1].eye, views[i].eye);
      CHECK(now < 1.3 * before);
      CHECK(now > before / 1.3);
      CHECK(off(glm::transpose(views[i].axes) * views[i].axes, glm::dmat3(1)) < 1e-12);
      CHECK(glm::determinant(views[i].axes) == doctest::Approx(1));
    }
  }
  CameraPath line;
  for (const double x : {0.0, 1.0, 5.0, 6.0}) line.keys.push_back(key_at({x, 0, 0}, {x, 0, 9}));
  for (const Keyframe& view : path_views(line, 50)) CHECK(std::abs(view.eye.y) < 1e-12);
}

TEST_CASE("seconds share out the time, and constant speed leaves them aside") {
  CameraPath path;
  for (const double x : {0.0, 1.0, 5.0}) path.keys.push_back(key_at({x, 0, 0}, {x, 0, 9}));
  path.keys[0].seconds = 3;
  path.keys[1].seconds = 1;
  auto views = path_views(path, 9);
  CHECK(views[6].eye.x == doctest::Approx(1));
  CHECK(views[8].eye.x == doctest::Approx(5));
  path.constant_speed = true;
  views = path_views(path, 101);
  for (std::size_t i = 1; i < views.size(); ++i)
    CHECK(views[i].eye.x - views[i - 1].eye.x == doctest::Approx(0.05).epsilon(0.02));
  // Without any seconds the spans take the same time.
  path.constant_speed = false;
  path.keys[0].seconds = path.keys[1].seconds = path.keys[2].seconds = 0;
  views = path_views(path, 5);
  CHECK(views[0].eye.x == doctest::Approx(0));
  CHECK(views[2].eye.x == doctest::Approx(1));
  CHECK(views[4].eye.x == doctest::Approx(5));
  // A path that only turns has no length to go along.
  CameraPath turning;
  turning.constant_speed = true;
  turning.keys = {key_at({0, 0, 0}, {0, 0, 1}), key_at({0, 0, 0}, {1, 0, 0})};
  views = path_views(turning, 3);
  const double half = std::sqrt(0.5);
  CHECK(glm::distance(views[1].axes[2], glm::dvec3(half, 0, half)) < 1e-9);
  turning.keys.resize(1);
  CHECK(path_views(turning, 5).size() == 5);
  CHECK_THROWS_AS(path_views(CameraPath(), 5), UsageError);
  CHECK_THROWS_AS(path_views(turning, 0), UsageError);
}

TEST_CASE("cameras and keyframes say the same") {
  const Camera camera = look_at({1, 2, 3}, {0, 0, 0}, {0, -1, 0}, 80, 60, 55);
  const Camera back = camera_of(keyframe_of(camera), 80, 60);
  CHECK(glm::distance(back.center(), camera.center()) < 1e-9);
  CHECK(off(back.rotation, camera.rotation) < 1e-12);
  CHECK(back.fy == doctest::Approx(camera.fy));
  const Camera other = look_at({3, 2, 3}, {0, 0, 0}, {0, -1, 0}, 80, 60, 65);
  CHECK(glm::distance(between(camera, other, 0.25).center(), glm::dvec3(1.5, 2, 3)) < 1e-9);
  CHECK(between(camera, other, 0.5).fx == doctest::Approx(60));
  CHECK(off(between(camera, other, 1).rotation, other.rotation) < 1e-9);
  CHECK(glm::distance(between(camera, other, 1.5).center(), glm::dvec3(4, 2, 3)) < 1e-9);
  // Backwards from the last of a path: it moves on, and a zoom stays where it is.
  CHECK(glm::distance(between(other, camera, -0.5).center(), glm::dvec3(4, 2, 3)) < 1e-9);
  CHECK(off(between(other, camera, -0.5).rotation, between(camera, other, 1.5).rotation) < 1e-9);
  CHECK(between(other, camera, -0.5).fx == 65);
  CHECK(between(camera, other, 1.5).fx == 65);
}

TEST_CASE("between cameras of different sizes or lenses the first keeps its own") {
  const Camera camera = look_at({1, 2, 3}, {0, 0, 0}, {0, -1, 0}, 80, 60, 55);
  Camera other = look_at({3, 2, 3}, {0, 0, 0}, {0, -1, 0}, 80, 60, 65);
  const auto check_kept = [&] {
    const Camera half = between(camera, other, 0.5);
    CHECK(half.fx == camera.fx);
    CHECK(half.cx == camera.cx);
    CHECK(half.width == camera.width);
    CHECK(half.model == camera.model);
    CHECK_FALSE(half.distortion.any());
    CHECK(glm::distance(half.center(), glm::dvec3(2, 2, 3)) < 1e-9);
  };
  other.model = CameraModel::kOpenCv;
  other.distortion.k1 = 0.1;
  check_kept();
  other = look_at({3, 2, 3}, {0, 0, 0}, {0, -1, 0}, 160, 60, 65);
  check_kept();
}

TEST_CASE("paths along photos lie where the photos do") {
  const auto photos = ring(40, 5, 2);
  const auto ellipse = ellipse_cameras(photos, 16);
  REQUIRE(ellipse.size() == 16);
  for (const Camera& camera : ellipse) {
    const glm::dvec3 eye = camera.center();
    CHECK(eye.x * eye.x / 25 + eye.z * eye.z / 4 == doctest::Approx(1).epsilon(1e-6));
    CHECK(eye.y == doctest::Approx(-1).epsilon(1e-6));
    // What the photos look at is in the middle.
    const glm::dvec3 seen = camera.rotation * glm::dvec3(0) + camera.translation;
    CHECK(std::abs(seen.x / seen.z) < 0.05);
    CHECK(camera.width == 64);
    CHECK(camera.fx == 60);
  }
  std::vector<Camera> forward;
  for (int i = 0; i < 9; ++i) {
    const glm::dvec3 eye(i % 3 - 1, 0.5 * (i / 3 - 1), 0);
    forward.push_back(look_at(eye, eye + glm::dvec3(0, 0, 1), {0, -1, 0}, 64, 48, 60));
  }
  for (const Camera& camera : spiral_cameras(forward, 24)) {
    CHECK(std::abs(camera.center().x) < 1.001);
    CHECK(std::abs(camera.center().y) < 0.501);
    CHECK(glm::transpose(camera.rotation)[2].z > 0.95);
  }
  // Photos straight down whose ups cancel have none that a spiral could keep.
  std::vector<Camera> downward;
  for (int i = 0; i < 8; ++i) {
    const glm::dvec3 eye(0.3 * (i / 2), -5, 0.2 * (i % 2));
    downward.push_back(
        look_at(eye, eye + glm::dvec3(0, 5, 0), {0, 0, i % 2 == 0 ? -1 : 1}, 64, 48, 50));
  }
  for (const Camera& camera : spiral_cameras(downward, 24)) {
    CHECK(std::abs(camera.center().x - 0.45) < 0.46);
    CHECK(glm::transpose(camera.rotation)[2].y > 0.95);
    CHECK(glm::transpose(camera.rotation)[1].z > 0.95);  // as the first photo
  }
  const auto steps = interpolated_cameras(forward, 4);
  REQUIRE(steps.size() == 33);
  for (std::size_t i = 0; i < forward.size(); ++i) {
    CHECK(glm::distance(steps[4 * i].center(), forward[i].center()) < 1e-9);
    CHECK(steps[4 * i].fx == doctest::Approx(60));
  }
  CHECK_THROWS_AS(ellipse_cameras(forward, 8), UsageError);  // no common point
  CHECK_THROWS_AS(spiral_cameras({}, 8), UsageError);
  CHECK_THROWS_AS(spiral_cameras(photos, 8), UsageError);  // all around
  CHECK_THROWS_AS(interpolated_cameras({forward.data(), 1}, 8), UsageError);
}
