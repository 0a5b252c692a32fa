// SPDX-License-Identifier: Apache-2.0
#include "raysplats/camera.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <limits>
#include <utility>

#include "raysplats/error.hpp"
#include "scene/camera/camera_check.hpp"

using namespace raysplats;

namespace {

bool close(const glm::dvec3& a, const glm::dvec3& b) { return glm::length(a - b) < 1e-12; }

void check_rotation(const glm::dmat3& r) {
  CHECK(close((r * glm::transpose(r))[0], {1, 0, 0}));
  CHECK(close((r * glm::transpose(r))[1], {0, 1, 0}));
  CHECK(close((r * glm::transpose(r))[2], {0, 0, 1}));
  CHECK(glm::determinant(r) == doctest::Approx(1));
}

}  // namespace

TEST_CASE("camera: downscaled keeps the field of view on both axes") {
  Camera camera;
  camera.name = "a.png";
  camera.width = 101;
  camera.height = 67;
  camera.fx = 90;
  camera.fy = 80;
  camera.cx = 50;
  camera.cy = 30;
  camera.translation = {1, 2, 3};
  for (const double factor : {1.0, 2.0, 4.0, 3.7, 0.5}) {
    CAPTURE(factor);
    const Camera small = downscaled(camera, factor);
    CHECK(std::abs(small.width - 101 / factor) <= 0.5);
    CHECK(std::abs(small.height - 67 / factor) <= 0.5);
    CHECK(small.fx / small.width == doctest::Approx(camera.fx / camera.width));
    CHECK(small.fy / small.height == doctest::Approx(camera.fy / camera.height));
    CHECK(small.cx / small.width == doctest::Approx(camera.cx / camera.width));
    CHECK(small.cy / small.height == doctest::Approx(camera.cy / camera.height));
    CHECK(small.translation == camera.translation);
    CHECK(small.name == camera.name);
  }
  const double infinity = std::numeric_limits<double>::infinity();
  for (const double factor : {0.0, -1.0, -infinity, infinity - infinity, 1e-9}) {
    CAPTURE(factor);
    CHECK_THROWS_AS(downscaled(camera, factor), UsageError);
  }
  const Camera least = downscaled(camera, 1000);
  CHECK(least.width == 1);
  CHECK(least.height == 1);
}

TEST_CASE("camera: a rotation is one up to rounding, whatever is multiplied to it or mirrored") {
  const glm::dmat3 turn = look_at({1, 2, 3}, {-4, 0, 5}, {0, 0, 1}, 4, 3, 5).rotation;
  CHECK(is_rotation(turn));
  CHECK(is_rotation(glm::dmat3(glm::mat3(turn))));
  CHECK(is_rotation(1.0004 * turn));
  CHECK(!is_rotation(1.0006 * turn));
  CHECK(!is_rotation(-1.0 * turn));
  CHECK(!is_rotation(glm::dmat3(0.0)));
  glm::dmat3 other = turn;
  other[1] += 0.002 * turn[0];  // a shear
  CHECK(!is_rotation(other));
  other = turn;
  std::swap(other[0], other[1]);
  CHECK(!is_rotation(other));
  other = turn;
  other[2][1] = std::numeric_limits<double>::quiet_NaN();
  CHECK(!is_rotation(other));
}

TEST_CASE("camera: look_at puts the target on the axis, up above and right to the right") {
  const glm::dvec3 eye(1, 2, 3);
  const glm::dvec3 target(-4, 0, 5);
  const glm::dvec3 up(0, 0, 1);
  const Camera camera = look_at(eye, target, up, 640, 480, 500);
  check_rotation(camera.rotation);
  CHECK(close(camera.center(), eye));
  const glm::dvec3 seen = camera.rotation * target + camera.translation;
  CHECK(close(seen, {0, 0, glm::length(target - eye)}));
  const glm::dvec3 above = camera.rotation * (target + up) + camera.translation;
  CHECK(above.y < 0);  // y points down
  CHECK(std::abs(above.x) < 1e-12);
  const glm::dvec3 right =
      camera.rotation * (target + glm::cross(target - eye, up)) + camera.translation;
  CHECK(right.x > 0);
  CHECK(camera.width == 640);
  CHECK(camera.height == 480);
  CHECK(camera.fx == 500);
  CHECK(camera.fy == 500);
  CHECK(camera.cx == 320);
  CHECK(camera.cy == 240);
}

TEST_CASE("camera: looking along up still gives a rotation") {
  for (const glm::dvec3& direction :
       {glm::dvec3(0, 0, 1), glm::dvec3(0, 0, -1), glm::dvec3(1, 0, 0), glm::dvec3(0, 1, 0)}) {
    const Camera camera =
        look_at({5, 5, 5}, glm::dvec3(5, 5, 5) + 3.0 * direction, direction, 10, 10, 10);
    check_rotation(camera.rotation);
    CHECK(close(camera.rotation * direction, {0, 0, 1}));
    CHECK(close(camera.center(), {5, 5, 5}));
  }
}

TEST_CASE("camera: look_at takes up of any length, and refuses what gives no direction") {
  const glm::dvec3 eye(1, 2, 3), target(-4, 0, 5), up(0.1, 0.2, 1);
  const Camera camera = look_at(eye, target, up, 10, 10, 10);
  for (const double length : {1e-12, 1e12}) {
    const Camera other = look_at(eye, target, length * up, 10, 10, 10);
    for (int k = 0; k < 3; ++k) CHECK(close(other.rotation[k], camera.rotation[k]));
  }
  check_rotation(look_at(eye, target, {0, 0, 0}, 10, 10, 10).rotation);
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  CHECK_THROWS_AS(look_at(eye, eye, up, 10, 10, 10), UsageError);
  CHECK_THROWS_AS(look_at({0, 0, 1e-200}, {0, 0, 0}, up, 10, 10, 10), UsageError);
  CHECK_THROWS_AS(look_at({1e200, 0, 0}, target, up, 10, 10, 10), UsageError);
  for (const double odd : {nan, inf}) {
    CHECK_THROWS_AS(look_at({odd, 0, 0}, target, up, 10, 10, 10), UsageError);
    CHECK_THROWS_AS(look_at(eye, {0, odd, 0}, up, 10, 10, 10), UsageError);
    CHECK_THROWS_AS(look_at({odd, 0, 0}, {odd, 0, 0}, up, 10, 10, 10), UsageError);
    CHECK_THROWS_AS(look_at(eye, target, {0, 0, odd}, 10, 10, 10), UsageError);
    CHECK_THROWS_AS(look_at(eye, target, up, 10, 10, odd), UsageError);
  }
}
