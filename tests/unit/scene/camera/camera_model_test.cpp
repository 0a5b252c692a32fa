// SPDX-License-Identifier: Apache-2.0
#include "scene/camera/camera_model.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <vector>

#include "reference/scenes.hpp"
#include "util/rng.hpp"

using namespace raysplats;
using reference::posed;

namespace {

constexpr double kPi = std::numbers::pi;

/// A camera at the origin that looks along z.
Camera plain(CameraModel model, int width, int height, double focal, Distortion d = {}) {
  Camera camera;
  camera.width = width;
  camera.height = height;
  camera.fx = camera.fy = focal;
  camera.cx = width / 2.0;
  camera.cy = height / 2.0;
  camera.model = model;
  camera.distortion = d;
  return camera;
}

double distance(const glm::dvec3& a, const glm::dvec3& b) { return glm::length(a - b); }

std::vector<Camera> cameras() {
  return {
      posed(CameraModel::kPinhole, 640, 480, 520, 515),
      posed(CameraModel::kOpenCv, 640, 480, 520, 515, {-0.12, 0.05, 0.008, 0.0021, -0.0013, 0}),
      posed(CameraModel::kOpenCv, 540, 960, 684, 681, {0.0578, -0.0805, 0, -0.00098, 0.00016, 0}),
      posed(CameraModel::kOpenCv, 300, 200, 210, 230, {0.31, 0.08, 0, 0, 0, 0}),
      posed(CameraModel::kFisheye, 800, 600, 270, 272, {0.0421, -0.0113, 0.0037, 0, 0, -0.00081}),
      posed(CameraModel::kFisheye, 400, 400, 110, 110),
      posed(CameraModel::kEquirectangular, 512, 256, 1, 1),
      posed(CameraModel::kOrthographic, 320, 240, 80, 95),
  };
}

}  // namespace

TEST_CASE("camera models: a ray's points project to where it came from") {
  CounterRng rng(3, 1);
  for (const Camera& camera : cameras()) {
    CAPTURE(static_cast<int>(camera.model));
    int valid = 0;
    for (int i = 0; i < 2000; ++i) {
      const double px = camera.width * rng.uniform();
      const double py = camera.height * rng.uniform();
      const CameraRay ray = camera_ray(camera, px, py);
      if (!ray.valid) continue;
      ++valid;
      CHECK(glm::length(ray.direction) == doctest::Approx(1).epsilon(1e-12));
      if (camera.model != CameraModel::kOrthographic)
        CHECK(distance(ray.origin, camera.center()) < 1e-12);
      const auto seen = project(camera, ray.origin + std::exp(rng.normal()) * ray.direction);
      REQUIRE(seen);
      CHECK(std::hypot(seen->x - px, seen->y - py) < 1e-8);
    }
    CHECK(valid >= (camera.model == CameraModel::kFisheye ? 1500 : 2000));
  }
}

TEST_CASE("camera models: projections equal those of OpenCV 4.6") {
  const glm::dvec3 points[] = {{0.3, -0.2, 1.0}, {1.1, 0.7, 2.0}, {-2.0, 1.5, 2.5}};
  Camera camera = plain(CameraModel::kOpenCv, 1920, 1080, 1234.5);
  camera.fy = 1220.0;
  camera.cx = 960.25;
  camera.cy = 541.75;
  camera.distortion = {-0.12, 0.05, 0.008, 0.0021, -0.0013, 0};
  // cv::projectPoints
  const double opencv[][2] = {{1324.3333975216, 302.0742714560},
                              {1610.4913412406, 952.1975051250},
                              {27.7333900000, 1234.2952000000}};
  // cv::fisheye::projectPoints
  const double fisheye[][2] = {{1317.4342330630, 306.4240843327},
                               {1569.7236335906, 925.0413458422},
                               {167.1998221185, 1129.5514684177}};
  for (int i = 0; i < 3; ++i) {
    CHECK(project(camera, points[i])->x == doctest::Approx(opencv[i][0]).epsilon(1e-12));
    CHECK(project(camera, points[i])->y == doctest::Approx(opencv[i][1]).epsilon(1e-12));
  }
  camera.model = CameraModel::kFisheye;
  camera.distortion = {0.0421, -0.0113, 0.0037, 0, 0, -0.00081};
  for (int i = 0; i < 3; ++i) {
    CHECK(project(camera, points[i])->x == doctest::Approx(fisheye[i][0]).epsilon(1e-12));
    CHECK(project(camera, points[i])->y == doctest::Approx(fisheye[i][1]).epsilon(1e-12));
  }
}

TEST_CASE("camera models: a lens ends where its polynomial stops growing") {
  // Slope 1 - 0.9 s of the radius, zero at s = 1/0.9.
  const Distortion barrel{-0.3, 0, 0, 0, 0, 0};
  CHECK(lens_limit(CameraModel::kOpenCv, barrel) == doctest::Approx(std::sqrt(1 / 0.9)));
  // 1 - 1.5 s + 0.5 s^2 = (1 - s)(1 - s/2): it grows again beyond s = 2, where no lens is.
  const Distortion wave{-0.5, 0.1, 0, 0, 0, 0};
  CHECK(lens_limit(CameraModel::kOpenCv, wave) == doctest::Approx(1.0));
  CHECK(lens_limit(CameraModel::kOpenCv, {0.1, 0.01, 0, 0, 0, 0}) == 1000.0);
  CHECK(lens_limit(CameraModel::kFisheye, {}) == doctest::Approx(kPi));
  // 1 - 9 k4 t^4 with t the squared angle.
  CHECK(lens_limit(CameraModel::kFisheye, {0, 0, 0, 0, 0, -0.01}) ==
        doctest::Approx(std::pow(1 / 0.09, 0.125)));
  CHECK(lens_limit(CameraModel::kPinhole, barrel) == 0.0);

  const Camera camera = plain(CameraModel::kOpenCv, 1000, 1000, 500, barrel);
  const double limit = std::sqrt(1 / 0.9);
  const double edge = 500 * limit * (1 - 0.3 * limit * limit);
  CHECK(camera_ray(camera, 500 + edge - 0.1, 500).valid);
  CHECK_FALSE(camera_ray(camera, 500 + edge + 0.1, 500).valid);
  CHECK(camera_ray(camera, 500 + edge - 1e-9, 500).direction.x ==
        doctest::Approx(std::sin(std::atan(limit))).epsilon(1e-4));
  CHECK(project(camera, {0.99 * limit, 0, 1}));
  CHECK_FALSE(project(camera, {1.01 * limit, 0, 1}));
  CHECK_FALSE(project(camera, {0.1, 0, -1}));
}

TEST_CASE("camera models: no point beyond a lens is seen, all within it are") {
  CounterRng rng(11, 1);
  for (int lens = 0; lens < 100; ++lens) {
    const Distortion d{0.3 * rng.normal(), 0.1 * rng.normal(), 0.03 * rng.normal(), 0, 0,
                       0.01 * rng.normal()};
    for (const CameraModel model : {CameraModel::kOpenCv, CameraModel::kFisheye}) {
      const Camera camera = plain(model, 1000, 1000, 500, d);
      const double limit = lens_limit(model, d);
      for (const double share : {0.2, 0.6, 0.9, 0.999, 1.001, 1.1, 2.0}) {
        const double r = share * limit;
        const bool fisheye = model == CameraModel::kFisheye;
        if (fisheye && r > kPi) continue;
        const glm::dvec3 point =
            fisheye ? glm::dvec3(std::sin(r), 0, std::cos(r)) : glm::dvec3(r, 0, 1);
        CHECK(project(camera, point).has_value() == (share < 1));
      }
    }
  }
}

TEST_CASE("camera models: fisheye reaches behind the camera") {
  const Camera camera = plain(CameraModel::kFisheye, 800, 800, 150);
  // 120 degrees from the axis, downwards.
  const CameraRay ray = camera_ray(camera, 400, 400 + 150 * kPi * 2 / 3);
  REQUIRE(ray.valid);
  CHECK(distance(ray.direction, {0, std::sin(kPi * 2 / 3), -0.5}) < 1e-12);
  CHECK_FALSE(camera_ray(camera, 400 + 150 * 3.15, 400).valid);
  CHECK(distance(camera_ray(camera, 400, 400).direction, {0, 0, 1}) == 0.0);
  CHECK(project(camera, {0, 0, 3})->x == 400.0);
  CHECK_FALSE(project(camera, {0, 0, 0}));
}

TEST_CASE("camera models: equirectangular columns are longitudes, rows latitudes") {
  const Camera camera = plain(CameraModel::kEquirectangular, 400, 200, 1);
  CHECK(distance(camera_ray(camera, 200, 100).direction, {0, 0, 1}) < 1e-12);
  CHECK(distance(camera_ray(camera, 300, 100).direction, {1, 0, 0}) < 1e-12);
  CHECK(distance(camera_ray(camera, 100, 100).direction, {-1, 0, 0}) < 1e-12);
  CHECK(distance(camera_ray(camera, 0, 100).direction, {0, 0, -1}) < 1e-12);
  CHECK(distance(camera_ray(camera, 123, 0).direction, {0, -1, 0}) < 1e-12);
  CHECK(distance(camera_ray(camera, 200, 150).direction, {0, std::sqrt(0.5), std::sqrt(0.5)}) <
        1e-12);
  CHECK_FALSE(camera_ray(camera, 200, -1).valid);
  CHECK_FALSE(project(camera, {0, 0, 0}));
}

TEST_CASE("camera models: orthographic rays are parallel") {
  const Camera camera = plain(CameraModel::kOrthographic, 400, 200, 50);
  const CameraRay ray = camera_ray(camera, 250, 75);
  CHECK(ray.valid);
  CHECK(distance(ray.direction, {0, 0, 1}) == 0.0);
  CHECK(distance(ray.origin, {1, -0.5, 0}) < 1e-12);
  CHECK_FALSE(project(camera, {0, 0, -1}));
}
