// SPDX-License-Identifier: Apache-2.0
#include "scene/camera/orbit.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <utility>

#include "raysplats/error.hpp"
#include "scene/camera/camera_model.hpp"
#include "util/rng.hpp"

using namespace raysplats;

namespace {

/// Opaque Gaussians on a sphere of radius 2 around `center`.
Gaussians sphere_model(const glm::dvec3& center, std::size_t count) {
  Gaussians model;
  model.resize(count);
  CounterRng rng(7, 0);
  for (std::size_t i = 0; i < count; ++i) {
    const glm::dvec3 point =
        center + 2.0 * glm::normalize(glm::dvec3(rng.normal(), rng.normal(), rng.normal()));
    for (int k = 0; k < 3; ++k)
      model.means[3 * i + static_cast<std::size_t>(k)] = static_cast<float>(point[k]);
    for (std::size_t k = 0; k < 3; ++k) model.log_scales[3 * i + k] = -6.0f;
    model.opacities[i] = 4.0f;
  }
  return model;
}

glm::dvec3 to_camera(const Camera& camera, const glm::dvec3& point) {
  return camera.rotation * point + camera.translation;
}

}  // namespace

TEST_CASE("the extent ignores stray, transparent and non-finite Gaussians") {
  const glm::dvec3 center(10, -20, 30);
  Gaussians model = sphere_model(center, 2000);
  const std::size_t before = model.size();
  model.resize(before + 1200);
  for (std::size_t i = before; i < model.size(); ++i) {
    const bool stray = i < before + 40;
    model.means[3 * i] = stray ? 1e6f : 500.0f;
    model.opacities[i] = stray ? 4.0f : -20.0f;
  }
  model.means[3 * before] = std::numeric_limits<float>::quiet_NaN();
  const SceneExtent extent = scene_extent(model);
  CHECK(glm::length(extent.center - center) < 0.2);
  CHECK(extent.radius == doctest::Approx(2.0).epsilon(0.1));
  CHECK(scene_extent(Gaussians{}).radius == 1.0);
}

TEST_CASE("orbits show 98 % of a model, whatever its shape and the camera's model") {
  CounterRng rng(8, 0);
  for (const glm::dvec3& shape :
       {glm::dvec3(1, 1, 1), glm::dvec3(8, 0.2, 0.3), glm::dvec3(4, 0.1, 4), glm::dvec3(0)}) {
    CAPTURE(shape.x);
    // Boxes of flat Gaussians that lie along them.
    Gaussians model;
    model.resize(1500);
    for (std::size_t i = 0; i < model.size(); ++i) {
      for (std::size_t k = 0; k < 3; ++k) {
        model.means[3 * i + k] =
            static_cast<float>(5.0 + shape[static_cast<int>(k)] * (2.0 * rng.uniform() - 1.0));
        model.log_scales[3 * i + k] = std::log(k == 1 ? 0.01f : 0.2f);
      }
      model.opacities[i] = static_cast<float>(2.0 * rng.normal());
    }
    const SceneExtent extent = scene_extent(model);
    for (const CameraModel lens :
         {CameraModel::kPinhole, CameraModel::kFisheye, CameraModel::kOrthographic}) {
      CAPTURE(static_cast<int>(lens));
      OrbitOptions options;
      options.frames = 7;
      options.width = 90;
      options.height = 60;
      options.model = lens;
      for (const Camera& camera : orbit_cameras(extent, options)) {
        double seen = 0, all = 0;
        for (std::size_t i = 0; i < model.size(); ++i) {
          const double opacity = 1.0 / (1.0 + std::exp(-model.opacities[i]));
          all += opacity;
          // Two deviations to all sides, which lie within the square of the smaller side.
          bool inside = true;
          for (int k = 0; k < 6; ++k) {
            glm::dvec3 point(model.means[3 * i], model.means[3 * i + 1], model.means[3 * i + 2]);
            point[k / 2] += (k % 2 == 0 ? 2.0 : -2.0) * (k / 2 == 1 ? 0.01 : 0.2);
            const glm::dvec3 p = to_camera(camera, point);
            double x = p.x, y = p.y;
            if (lens == CameraModel::kPinhole) {
              x /= p.z;
              y /= p.z;
            }
            if (lens == CameraModel::kFisheye) {
              const double across = std::hypot(p.x, p.y);
              const double angle = std::atan2(across, p.z);
              x *= across > 0 ? angle / across : 0;
              y *= across > 0 ? angle / across : 0;
            }
            inside = inside && std::abs(camera.fx * x) < 30.0 && std::abs(camera.fy * y) < 30.0;
          }
          seen += inside ? opacity : 0;
        }
        CHECK(seen > 0.98 * all);
        CHECK(extent.radius < 3.0 * glm::length(shape) + 1.0);  // and not from far away
      }
    }
  }
}

TEST_CASE("a far background does not inflate the radius") {
  Gaussians model = sphere_model(glm::dvec3(0), 700);
  const std::size_t before = model.size();
  Gaussians background = sphere_model(glm::dvec3(0), 300);
  model.resize(1000);
  for (std::size_t i = 0; i < 300; ++i) {
    for (std::size_t k = 0; k < 3; ++k)
      model.means[3 * (before + i) + k] = 500.0f * background.means[3 * i + k];
    model.opacities[before + i] = 4.0f;
  }
  CHECK(scene_extent(model).radius < 4.5);
}

TEST_CASE("orbit cameras look at the centre from a circle and stay upright") {
  const SceneExtent extent{glm::dvec3(1, 2, 3), 2.0};
  for (const glm::dvec3& up : {glm::dvec3(0, -1, 0), glm::dvec3(0, 0, 3), glm::dvec3(1, 1, -1)}) {
    OrbitOptions options;
    options.frames = 8;
    options.width = 64;
    options.height = 48;
    options.fov_degrees = 40.0;
    options.elevation_degrees = 30.0;
    options.up = up;
    const std::vector<Camera> cameras = orbit_cameras(extent, options);
    REQUIRE(cameras.size() == 8);
    CHECK(cameras[3].name == "frame_0003");
    const glm::dvec3 axis = glm::normalize(up);
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      const Camera& camera = cameras[i];
      const glm::dvec3 target = to_camera(camera, extent.center);
      CHECK(std::abs(target.x) < 1e-9);
      CHECK(std::abs(target.y) < 1e-9);
      CHECK(target.z == doctest::Approx(2.0 / std::sin(20.0 * 3.14159265358979 / 180.0)));
      // A point above the centre is above it in the image (y points down), in the middle column.
      const glm::dvec3 above = to_camera(camera, extent.center + axis);
      CHECK(above.y < -0.5);
      CHECK(std::abs(above.x) < 1e-9);
      const glm::dvec3 arm = camera.center() - extent.center;
      CHECK(glm::dot(arm, axis) / glm::length(arm) == doctest::Approx(0.5));
      // Counter-clockwise seen from above, one eighth of a turn each.
      const glm::dvec3 next = cameras[(i + 1) % 8].center() - extent.center;
      const glm::dvec3 flat = arm - glm::dot(arm, axis) * axis;
      const glm::dvec3 flat_next = next - glm::dot(next, axis) * axis;
      CHECK(glm::dot(glm::cross(flat, flat_next), axis) > 0.0);
      CHECK(glm::dot(glm::normalize(flat), glm::normalize(flat_next)) ==
            doctest::Approx(std::sqrt(0.5)));
    }
    // The sphere of the extent touches the border of the smaller side.
    CHECK(field_of_view(cameras[0], CameraModel::kPinhole) == doctest::Approx(40.0));
    CHECK(cameras[0].fy * std::tan(20.0 * 3.14159265358979 / 180.0) == doctest::Approx(24.0));
  }
}

TEST_CASE("a fisheye orbit sees what fisheye photos see") {
  constexpr double kDegrees = 180.0 / 3.14159265358979;
  Camera photo = look_at({0, 0, -4}, {1, 0, 0}, {0, -1, 0}, 200, 100, 1.0);
  photo.model = CameraModel::kFisheye;
  photo.distortion.k1 = 0.02;
  photo.distortion.k2 = -0.003;
  photo.fx = photo.fy = 50.0 / radial_image(photo.model, photo.distortion, 1.5);
  CHECK(field_of_view(photo, CameraModel::kFisheye) == doctest::Approx(3.0 * kDegrees));
  CHECK(field_of_view(photo, CameraModel::kPinhole) ==
        doctest::Approx(2.0 * std::atan(50.0 / photo.fx) * kDegrees));
  std::swap(photo.width, photo.height);
  std::swap(photo.cx, photo.cy);
  CHECK(field_of_view(photo, CameraModel::kFisheye) == doctest::Approx(3.0 * kDegrees));
  // The whole circle of the lens lies within the picture.
  photo.distortion.k1 = -0.1;
  photo.fx = photo.fy = 20.0;
  CHECK(field_of_view(photo, CameraModel::kFisheye) ==
        doctest::Approx(2.0 * lens_limit(photo.model, photo.distortion) * kDegrees));
  // Nothing else has that angle.
  const Camera flat = look_at({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 200, 100, 50.0);
  CHECK(field_of_view(flat, CameraModel::kFisheye) == doctest::Approx(90.0));
}

TEST_CASE("an orbit around what panoramas saw has the usual angle") {
  Camera photo = look_at({0, 0, -4}, {0, 0, 0}, {0, -1, 0}, 200, 100, 0.0);
  for (const CameraModel without : {CameraModel::kEquirectangular, CameraModel::kOrthographic}) {
    photo.model = without;
    for (const CameraModel as : {CameraModel::kPinhole, CameraModel::kFisheye})
      CHECK(field_of_view(photo, as) == OrbitOptions().fov_degrees);
  }
}

TEST_CASE("up, distance and elevation come from the cameras") {
  OrbitOptions options;
  options.frames = 12;
  options.up = glm::dvec3(0, 0, 1);
  options.elevation_degrees = 35.0;
  options.distance = 5.0;
  const SceneExtent extent{glm::dvec3(1, 0, 0), 1.0};
  const std::vector<Camera> cameras = orbit_cameras(extent, options);
  const glm::dvec3 up = estimate_up(cameras);
  CHECK(glm::dot(up, glm::dvec3(0, 0, 1)) > 0.999);
  OrbitOptions fitted;
  fitted.up = up;
  fitted = orbit_like(cameras, extent.center, fitted);
  CHECK(fitted.distance == doctest::Approx(5.0));
  CHECK(fitted.elevation_degrees == doctest::Approx(35.0));
  CHECK(estimate_up({}) == glm::dvec3(0, -1, 0));
}

TEST_CASE("up is where photos straight down come from, whatever the lines of the flight were") {
  // Seven lines of nine, there and back: one line more looks the one way than the other.
  std::vector<Camera> flight;
  for (int line = 0; line < 7; ++line) {
    for (int i = 0; i < 9; ++i) {
      const glm::dvec3 eye(15.0 * i, 18.0 * line, 80.0);
      const glm::dvec3 heading(0.0, line % 2 == 0 ? 1.0 : -1.0, 0.0);
      flight.push_back(
          look_at(eye, eye + glm::dvec3(0.01 * (i % 3 - 1), 0.0, -1.0), heading, 60, 40, 50));
    }
  }
  CHECK(glm::dot(estimate_up(flight), glm::dvec3(0, 0, 1)) > 0.999);
  // Before a wall all look the same way too, and know what is up.
  std::vector<Camera> wall;
  wall.reserve(9);
  for (int i = 0; i < 9; ++i)
    wall.push_back(look_at({0.1 * i, 0, 0}, {0.1 * i, 4, 0}, {0, 0, 1}, 60, 40, 50));
  CHECK(glm::dot(estimate_up(wall), glm::dvec3(0, 0, 1)) > 0.999);
}

TEST_CASE("views that no photo vouches for are counted") {
  const auto camera = [](const glm::dvec3& eye, const glm::dvec3& target) {
    return look_at(eye, target, {0, -1, 0}, 80, 60, 70.0);
  };
  OrbitOptions options;
  options.frames = 24;
  options.distance = 4.0;
  const SceneExtent extent{glm::dvec3(0.0), 1.0};
  const std::vector<Camera> around = orbit_cameras(extent, options);
  std::vector<Camera> half(around.begin(), around.begin() + 12), corridor, panorama;
  for (int i = 0; i < 10; ++i) corridor.push_back(camera({0, 0, i - 5.0}, {0, 0, i}));
  Camera everywhere = camera({0, 0, 0}, {0, 0, 1});
  everywhere.model = CameraModel::kEquirectangular;
  panorama.push_back(everywhere);
  CHECK(unseen_views(around, around, 3.0) == 0);
  const std::size_t behind = unseen_views(around, half, 3.0);
  CHECK(behind >= 4);
  CHECK(behind <= 8);
  // Of a circle in a corridor, what looks along it at most.
  CHECK(unseen_views(around, corridor, 3.0) >= 14);
  CHECK(unseen_views(around, panorama, 5.0) == 0);
  CHECK(unseen_views(around, panorama, 3.0) == around.size());
  CHECK(unseen_views(around, {}, 3.0) == around.size());
  CHECK(unseen_views({}, around, 3.0) == 0);
}

TEST_CASE("photos that look at one point have it as their target, others have none") {
  const glm::dvec3 target(1.0, -2.0, 0.5);
  CounterRng rng(11, 0);
  const auto point = [&](double size) {
    return size * glm::dvec3(rng.normal(), rng.normal(), rng.normal());
  };
  std::vector<Camera> inwards, parallel, outwards;
  for (int i = 0; i < 40; ++i) {
    const glm::dvec3 eye = target + 4.0 * glm::normalize(point(1.0));
    inwards.push_back(look_at(eye, target + point(0.1), {0, 0, 1}, 80, 60, 70.0));
    const glm::dvec3 place(0.3 * rng.normal(), 0.3 * rng.normal(), 0.0);
    parallel.push_back(
        look_at(place, place + glm::dvec3(0, 0, 5) + point(0.2), {0, -1, 0}, 80, 60, 70.0));
    const glm::dvec3 middle = point(0.1);
    outwards.push_back(
        look_at(middle, middle + glm::normalize(point(1.0)), {0, 0, 1}, 80, 60, 70.0));
  }
  const std::optional<glm::dvec3> found = common_target(inwards);
  REQUIRE(found);
  CHECK(glm::distance(*found, target) < 0.1);
  CHECK_FALSE(common_target(parallel));
  CHECK_FALSE(common_target(outwards));
  CHECK_FALSE(common_target({}));
  CHECK_FALSE(common_target(std::vector<Camera>{inwards[0]}));
}

TEST_CASE("orbits of other camera models see the extent too") {
  const double degree = 3.14159265358979 / 180.0;
  const SceneExtent extent{glm::dvec3(1, 0, 0), 2.0};
  OrbitOptions options;
  options.frames = 3;
  options.width = 64;
  options.height = 48;
  options.model = CameraModel::kFisheye;
  options.fov_degrees = 120.0;
  const Camera fisheye = orbit_cameras(extent, options)[1];
  CHECK(fisheye.model == CameraModel::kFisheye);
  CHECK(fisheye.fx * 60.0 * degree == doctest::Approx(24.0));
  CHECK(to_camera(fisheye, extent.center).z == doctest::Approx(2.0 / std::sin(60.0 * degree)));
  options.fov_degrees = 220.0;
  CHECK(to_camera(orbit_cameras(extent, options)[2], extent.center).z == doctest::Approx(2.0));
  options.model = CameraModel::kEquirectangular;
  options.fov_degrees = 45.0;
  CHECK(to_camera(orbit_cameras(extent, options)[2], extent.center).z == doctest::Approx(2.0));
  options.model = CameraModel::kOrthographic;
  options.distance = 7.0;
  // The plane through the centre as a pinhole at that distance shows it.
  const Camera parallel = orbit_cameras(extent, options)[0];
  CHECK(24.0 / parallel.fx == doctest::Approx(7.0 * std::tan(22.5 * degree)));
  CHECK(to_camera(parallel, extent.center).z == doctest::Approx(7.0));
}

TEST_CASE("orbits that make no camera are refused") {
  const SceneExtent extent;
  const auto refused = [&](auto change) {
    OrbitOptions options;
    change(options);
    CHECK_THROWS_AS(orbit_cameras(extent, options), UsageError);
  };
  refused([](OrbitOptions& o) { o.frames = 0; });
  refused([](OrbitOptions& o) { o.width = 0; });
  refused([](OrbitOptions& o) { o.fov_degrees = 180.0; });
  refused([](OrbitOptions& o) { o.model = CameraModel::kOpenCv; });
  refused([](OrbitOptions& o) {
    o.model = CameraModel::kFisheye;
    o.fov_degrees = 361.0;
  });
  refused([](OrbitOptions& o) { o.elevation_degrees = 90.0; });
  refused([](OrbitOptions& o) { o.up = glm::dvec3(0.0); });
  refused([](OrbitOptions& o) { o.distance = -1.0; });
}
