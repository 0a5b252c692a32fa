// SPDX-License-Identifier: Apache-2.0
#include "train/start/plane_sweep.hpp"

#include <doctest/doctest.h>

#include <array>
#include <cmath>
#include <csignal>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <vector>

#include "raysplats/error.hpp"
#include "scene/camera/camera_model.hpp"
#include "unit/train/test_photos.hpp"
#include "util/interrupt.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

// A ball of 6 around the world's origin, seen from inside; its pattern is the finer the greater
// `fineness` is.
glm::dvec4 ball(const CameraRay& ray, double fineness) {
  const double along = glm::dot(ray.origin, ray.direction);
  const double t = std::sqrt(36.0 - glm::dot(ray.origin, ray.origin) + along * along) - along;
  const glm::dvec3 p = fineness * (ray.origin + t * ray.direction);
  return glm::dvec4(0.5 + 0.4 * std::sin(2.1 * p.y + 0.7 * p.z) * std::sin(1.3 * p.x),
                    0.5 + 0.4 * std::cos(2.3 * p.z - 1.1 * p.y + p.x),
                    0.5 + 0.4 * std::sin(2.7 * p.y - 1.9 * p.x), 1.0);
}

}  // namespace

TEST_CASE("sweeping finds a textured wall and its colours") {
  const std::vector<SmallPhoto> photos = photos_of_wall();
  const PointCloud points = swept_points(photos, {0.6, 3.0, 30.0}, 400, 0.25, 5).points;
  CHECK(points.positions == swept_points(photos, {0.6, 3.0, 30.0}, 400, 0.25, 5).points.positions);
  REQUIRE(points.size() >= 300);
  std::size_t near = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const float* p = points.positions.data() + 3 * i;
    if (std::abs(p[0] - 4.0) > 0.5) continue;
    ++near;
  }
  MESSAGE(near << " of " << points.size() << " points on the wall");
  CHECK(near > points.size() * 6 / 10);
}

TEST_CASE("half of the pixels that no depth explains are as deep as what is around them") {
  // A plain square in the middle of the wall tells no depth, but at its edges.
  std::vector<SmallPhoto> photos;
  const auto with_square = [](const CameraRay& ray) {
    const glm::dvec3 p = ray.origin + (4.0 - ray.origin.x) / ray.direction.x * ray.direction;
    return std::abs(p.y) < 0.7 && std::abs(p.z) < 0.7 ? glm::dvec4(0.9, 0.9, 0.2, 1.0) : wall(ray);
  };
  for (const SmallPhoto& photo : photos_of_wall())
    photos.push_back(photo_of(photo.camera, with_square));
  const PointCloud points = swept_points(photos, {0.6, 3.0, 30.0}, 600, 0.25, 5).points;
  std::size_t plain = 0, near = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (std::abs(points.colors[3 * i + 2] - 0.2f) > 0.01f) continue;
    ++plain;
    near += std::abs(points.positions[3 * i] - 4.0f) < 0.5f ? 1 : 0;
  }
  MESSAGE(near << " of " << plain << " plain points on the wall");
  CHECK(plain > 50);
  // And some of those at random depths.
  CHECK(near > plain / 2);
}

TEST_CASE("photos turned against each other tell as much of depth") {
  const std::array<glm::dvec3, 4> ups{{{0, 0, 1}, {0, 1, 0}, {0, 0, -1}, {0, -1, 0}}};
  const auto fine = [](const CameraRay& ray) {
    const glm::dvec3 p = ray.origin + (4.0 - ray.origin.x) / ray.direction.x * ray.direction;
    return glm::dvec4(0.5 + 0.4 * std::sin(23 * p.y + 5 * p.z),
                      0.5 + 0.4 * std::cos(19 * p.z - 7 * p.y),
                      0.5 + 0.4 * std::sin(17 * p.y - 13 * p.z), 1.0);
  };
  std::vector<SmallPhoto> upright, turned;
  for (int i = 0; i < 9; ++i) {
    const int row = i / 3;
    const double y = 0.4 * (i % 3 - 1), z = 0.4 * (row - 1);
    const glm::dvec3 eye(0, y, z), target(4, 0.5 * y, 0.5 * z);
    upright.push_back(photo_of(look_at(eye, target, ups[0], 80, 80, 90), fine));
    turned.push_back(
        photo_of(look_at(eye, target, ups[static_cast<std::size_t>(i % 4)], 80, 80, 90), fine));
  }
  const double plain = probe_sweep(upright, {0.6, 3.0, 30.0}, 5).agreed;
  const double other = probe_sweep(turned, {0.6, 3.0, 30.0}, 5).agreed;
  MESSAGE(plain << " of the pixels upright, " << other << " turned");
  CHECK(plain > 0.3);
  CHECK(other > 0.8 * plain);
}

TEST_CASE("panoramas tell as much of depth wherever their middles look") {
  // Along a hall, in which only near ones show a place alike.
  const auto hall = [](const CameraRay& ray) {
    const double across = std::hypot(ray.direction.y, ray.direction.z);
    const glm::dvec3 p = ray.origin + 2.0 / std::max(across, 0.05) * ray.direction;
    return glm::dvec4(0.5 + 0.4 * std::sin(5 * p.x + 2 * p.y),
                      0.5 + 0.4 * std::cos(4 * p.x - 3 * p.z),
                      0.5 + 0.4 * std::sin(6 * p.x + p.y - 2 * p.z), 1.0);
  };
  std::vector<SmallPhoto> alike, turned;
  for (int i = 0; i < 24; ++i) {
    const glm::dvec3 eye(0.5 * (i - 12), 0, 0);
    const auto looking = [&](double angle) {
      const glm::dvec3 to(std::cos(angle), std::sin(angle), 0);
      Camera camera = look_at(eye, eye + to, {0, 0, 1}, 144, 72, 72);
      set_equirectangular(camera);
      return photo_of(camera, hall);
    };
    alike.push_back(looking(0.0));
    turned.push_back(looking(2.4 * i));
  }
  const double plain = probe_sweep(alike, swept_depths(alike, 3.0, 3), 5).agreed;
  const double other = probe_sweep(turned, swept_depths(turned, 3.0, 3), 5).agreed;
  MESSAGE(plain << " of the pixels alike, " << other << " turned");
  CHECK(plain > 0.3);
  CHECK(other > 0.9 * plain);
}

TEST_CASE("photos through long lenses find a wall that a step of the usual length leaps over") {
  const auto far_wall = [](const CameraRay& ray) {
    const glm::dvec3 p = ray.origin - ray.origin.x / ray.direction.x * ray.direction;
    return glm::dvec4(0.5 + 0.4 * std::sin(9 * p.y + 4 * p.z),
                      0.5 + 0.4 * std::cos(8 * p.z - 5 * p.y),
                      0.5 + 0.4 * std::sin(7 * p.y - 6 * p.z), 1.0);
  };
  std::vector<SmallPhoto> photos;
  for (int i = 0; i < 9; ++i) {
    const int row = i / 3;
    const double across = 0.12 * (i % 3 - 1), up = 0.12 * (row - 1);
    const glm::dvec3 eye(-60 * std::cos(across) * std::cos(up), 60 * std::sin(across),
                         60 * std::sin(up));
    photos.push_back(photo_of(look_at(eye, {0, 0, 0}, {0, 0, 1}, 80, 60, 1800), far_wall));
  }
  const DepthRange depths = swept_depths(photos, 60, 3);
  CHECK(depths.typical == 60);
  CHECK(probe_sweep(photos, depths, 5).agreed > 0.3);
  const PointCloud points = swept_points(photos, depths, 400, 0.25, 5).points;
  std::size_t near = 0;
  for (std::size_t i = 0; i < points.size(); ++i)
    near += std::abs(points.positions[3 * i]) < 0.4f ? 1 : 0;
  MESSAGE(near << " of " << points.size() << " points on the wall");
  CHECK(near > points.size() * 6 / 10);
}

TEST_CASE("photos of different things agree in next to no depth") {
  std::vector<SmallPhoto> photos;
  for (const SmallPhoto& photo : photos_of_wall()) {
    const glm::dvec3 shift = static_cast<double>(photos.size()) * glm::dvec3(0, 9.7, 13.1);
    photos.push_back(photo_of(photo.camera, [shift](CameraRay ray) {
      ray.origin += shift;
      return wall(ray);
    }));
  }
  const double share = probe_sweep(photos, {0.6, 3.0, 30.0}, 5).agreed;
  MESSAGE(share << " of the pixels agree");
  CHECK(share < 0.012);
}

TEST_CASE("photos without a common view give no sure points and do not fail") {
  std::vector<SmallPhoto> one{photo_of(look_at({0, 0, 0}, {1, 0, 0}, {0, 0, 1}, 40, 30, 40), wall)};
  const PointCloud points = swept_points(one, {0.4, 2.0, 20.0}, 100, 0.25, 1).points;
  CHECK(points.size() == 25);
  for (const float p : points.positions) CHECK(std::isfinite(p));
}

TEST_CASE("a signal ends a sweep, and the next one is whole") {
  const std::vector<SmallPhoto> photos = photos_of_wall();
  const auto sweep = [&photos] { return swept_points(photos, {0.6, 3.0, 30.0}, 400, 0.25, 5); };
  {
    const InterruptGuard guard;
    CHECK(sweep().points.size() > 0);
    std::raise(SIGINT);
    ErrorCode code = ErrorCode::kRuntime;
    try {
      sweep();
    } catch (const Error& error) {
      code = error.code();
    }
    CHECK(code == ErrorCode::kInterrupted);
  }
  CHECK(sweep().points.size() > 0);
}

TEST_CASE("cameras on a tripod look at what is far away") {
  // Around one point that is 0.01 wide, in a ball whose pattern has no finer parts than pixels.
  const auto ball_around = [](const CameraRay& ray) { return ball(ray, 1.0); };
  for (const double radius : {0.0, 0.005}) {
    std::vector<SmallPhoto> photos;
    for (int i = 0; i < 16; ++i) {
      const glm::dvec3 to(std::cos(0.4 * i), std::sin(0.4 * i), 0.2 * (i % 3 - 1));
      photos.push_back(photo_of(look_at(radius * to, to, {0, 0, 1}, 80, 60, 70), ball_around));
    }
    const double guess = radius > 0 ? radius : 1.0;
    const DepthRange depths = swept_depths(photos, guess, 3);
    CHECK(depths.open);
    CHECK(foreground_points(photos, guess, 200, 3).size() == 0);
    const PointCloud points = swept_points(photos, depths, 400, 0.25, 3).points;
    CHECK(points.size() > 390);
    std::size_t far = 0;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const float* p = points.positions.data() + 3 * i;
      if (glm::length(glm::dvec3(p[0], p[1], p[2])) > (radius > 0 ? 10 * radius : 1.0)) ++far;
    }
    MESSAGE(far << " of " << points.size() << " points beyond 10 radii");
    CHECK(far > points.size() * 8 / 10);
  }
  // Photos that tell depths keep the guess.
  const std::vector<SmallPhoto> photos = photos_of_wall();
  const DepthRange depths = swept_depths(photos, 3.0, 3);
  CHECK(!depths.open);
  CHECK(depths.typical == 3.0);
  // So do those of an object before a white backdrop, which agrees with itself at any depth.
  std::vector<SmallPhoto> studio;
  studio.reserve(photos.size());
  for (const SmallPhoto& photo : photos) {
    studio.push_back(photo_of(photo.camera, [](const CameraRay& ray) {
      const glm::dvec3 p = ray.origin + (4.0 - ray.origin.x) / ray.direction.x * ray.direction;
      return std::abs(p.y) < 0.5 && std::abs(p.z) < 0.5 ? wall(ray) : glm::dvec4(1.0);
    }));
  }
  const DepthRange before_white = swept_depths(studio, 3.0, 3);
  CHECK(!before_white.open);
  CHECK(before_white.typical == 3.0);
}

TEST_CASE("what stands before far mountains is found though most pixels tell no depth") {
  // A terrace's wall in the lower part of the photos, and what is too far to move between them.
  const auto outlook = [](const CameraRay& ray) {
    const glm::dvec3 p = ray.origin + 4.0 / ray.direction.x * ray.direction;
    if (p.z < -0.4) {
      return glm::dvec4(0.5 + 0.4 * std::sin(11 * p.y + 5 * p.z),
                        0.5 + 0.4 * std::cos(9 * p.z - 7 * p.y),
                        0.5 + 0.4 * std::sin(8 * p.y - 6 * p.z), 1.0);
    }
    const glm::dvec3 far = 40.0 * ray.direction;
    return glm::dvec4(0.5 + 0.4 * std::sin(far.y + far.z), 0.5 + 0.4 * std::cos(2 * far.z - far.y),
                      0.5 + 0.4 * std::sin(2 * far.y), 1.0);
  };
  std::vector<SmallPhoto> photos;
  for (int i = 0; i < 25; ++i) {
    const int row = i / 5;
    const glm::dvec3 eye(0, 0.5 * (i % 5 - 2), 0.2 * (row - 2));
    photos.push_back(
        photo_of(look_at(eye, eye + glm::dvec3(1, 0, 0), {0, 0, 1}, 96, 72, 80), outlook));
  }
  const DepthRange depths = swept_depths(photos, 3.0, 3);
  CHECK(depths.open);
  CHECK(depths.nearest > 5.0);
  const PointCloud points = foreground_points(photos, 3.0, 200, 3);
  CHECK(points.positions == foreground_points(photos, 3.0, 200, 3).positions);
  std::size_t found = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const float* q = points.positions.data() + 3 * i;
    found += std::abs(q[0] - 4.0f) < 0.5f && q[2] < -0.2f ? 1 : 0;
  }
  MESSAGE(found << " of " << points.size() << " points on the wall");
  CHECK(points.size() > 100);
  CHECK(points.size() <= 200);
  CHECK(found > points.size() * 8 / 10);

  // A start has both, and together no more than it asked for.
  const PointCloud all = searched_points(photos, 3.0, 400, 0.25, 3).points;
  CHECK(all.size() > 390);
  CHECK(all.size() <= 400);
  std::size_t before = 0;
  for (std::size_t i = 0; i < all.size(); ++i) before += all.positions[3 * i] < depths.nearest;
  CHECK(before == points.size());
}

TEST_CASE("what lies far beyond what most pixels show is found as well") {
  // A wall in the lower part of the photos, and another fifteen times as far behind it.
  const auto walls = [](const CameraRay& ray) {
    glm::dvec3 p = ray.origin + 4.0 / ray.direction.x * ray.direction;
    const bool near = p.z < 0.4;
    if (!near) p = (ray.origin + 60.0 / ray.direction.x * ray.direction) / 15.0;
    return glm::dvec4(0.5 + 0.4 * std::sin(11 * p.y + 5 * p.z),
                      0.5 + 0.4 * std::cos(9 * p.z - 7 * p.y),
                      0.5 + 0.4 * std::sin(8 * p.y - 6 * p.z), 1.0);
  };
  std::vector<SmallPhoto> photos;
  for (int i = 0; i < 25; ++i) {
    const glm::dvec3 eye(0, 0.6 * (i - 12), 0.1 * (i % 3 - 1));
    photos.push_back(
        photo_of(look_at(eye, eye + glm::dvec3(1, 0, 0), {0, 0, 1}, 96, 72, 80), walls));
  }
  const DepthRange depths = swept_depths(photos, 4.0, 3);
  CHECK(!depths.open);
  CHECK(depths.farthest < 50.0);
  const PointCloud points = background_points(photos, depths, 400, 3);
  CHECK(points.positions == background_points(photos, depths, 400, 3).positions);
  std::size_t found = 0;
  for (std::size_t i = 0; i < points.size(); ++i)
    found += std::abs(points.positions[3 * i] - 60.0f) < 10.0f ? 1 : 0;
  MESSAGE(found << " of " << points.size() << " points on the wall behind");
  CHECK(points.size() > 30);
  CHECK(points.size() < 300);
  CHECK(found > points.size() * 7 / 10);
  // A start has both, and together no more than it asked for.
  const PointCloud all = searched_points(photos, 4.0, 400, 0.25, 3).points;
  CHECK(all.size() > 390);
  CHECK(all.size() <= 400);
  // Where next to nothing is there, none are taken.
  const std::vector<SmallPhoto> one = photos_of_wall();
  CHECK(background_points(one, swept_depths(one, 3.0, 3), 400, 3).size() == 0);
}

TEST_CASE("what is so far away that its depth moves no pixel is found at some such depth") {
  // A step of a tenth at the wall's distance moves it by a seventh of a pixel in the next photo.
  const auto far_wall = [](const CameraRay& ray) {
    const glm::dvec3 p = (ray.origin + 400.0 / ray.direction.x * ray.direction) / 100.0;
    return wall({{0, 0, 0}, p / 4.0, true});
  };
  std::vector<SmallPhoto> photos;
  for (int i = 0; i < 13; ++i) {
    const glm::dvec3 eye(0, 1.2 * (i - 6), 0.3 * (i % 3 - 1));
    photos.push_back(
        photo_of(look_at(eye, eye + glm::dvec3(1, 0, 0), {0, 0, 1}, 96, 72, 80), far_wall));
  }
  const DepthRange depths{4.0, 40.0, 800.0};
  const SweptPoints found = probe_sweep(photos, depths, 3);
  MESSAGE(found.agreed << " agrees");
  CHECK(found.agreed > 0.5);
  // Six metres of cameras beside each other tell 400 from 200 by 1.2 pixels.
  std::size_t far = 0;
  for (std::size_t i = 0; i < found.points.size(); ++i)
    far += found.points.positions[3 * i] > 150.0f ? 1 : 0;
  CHECK(far > found.points.size() * 9 / 10);
}

TEST_CASE("what has no clear depth may be up to a thousand times as far as what most see") {
  // Photos of one colour, in which no depth is clear.
  std::vector<SmallPhoto> photos = photos_of_wall();
  for (SmallPhoto& photo : photos)
    photo = photo_of(photo.camera, [](const CameraRay&) { return glm::dvec4(0.5); });
  const DepthRange depths = depths_around(4.0);
  const PointCloud points = swept_points(photos, depths, 400, 1.0, 5).points;
  REQUIRE(points.size() == 400);
  std::size_t near = 0, far = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const float* p = points.positions.data() + 3 * i;
    const double distance = glm::length(glm::dvec3(p[0], p[1], p[2]));
    CHECK(distance > 3.0);
    CHECK(distance < 4001.0);
    near += distance < 40.0 ? 1 : 0;
    far += distance > 400.0 ? 1 : 0;
  }
  // Evenly by the logarithm: a third of them each.
  CHECK(near > 90);
  CHECK(far > 90);
  // Beyond the far end of an open range nothing stands.
  const DepthRange open{0.4, 8.0, 12.0, true};
  const PointCloud shell = swept_points(photos, open, 400, 1.0, 5).points;
  for (std::size_t i = 0; i < shell.size(); ++i) CHECK(shell.positions[3 * i] < 12.1f);
}

TEST_CASE("cameras turned at arm's length find what is around them") {
  // Their axes meet where the one who turns stands, which tells nothing of what they look at.
  const auto room = [](const CameraRay& ray) { return ball(ray, 2.5); };
  std::vector<SmallPhoto> photos;
  for (int i = 0; i < 48; ++i) {
    const double angle = i * glm::radians(15.0);
    const glm::dvec3 to(std::cos(angle), std::sin(angle), 0);
    const glm::dvec3 eye = 0.4 * to + glm::dvec3(0, 0, i < 24 ? 0.2 : -0.2);
    photos.push_back(photo_of(look_at(eye, eye + to, {0, 0, 1}, 120, 90, 100), room));
  }
  const DepthRange depths = swept_depths(photos, 0.4, 3);
  CHECK(!depths.open);
  CHECK(depths.farthest > 9.0);
  const PointCloud points = swept_points(photos, depths, 400, 0.25, 5).points;
  std::size_t near = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const float* p = points.positions.data() + 3 * i;
    near += std::abs(glm::length(glm::dvec3(p[0], p[1], p[2])) - 6.0) < 1.0 ? 1 : 0;
  }
  MESSAGE(near << " of " << points.size() << " points where the room ends, typically "
               << depths.typical);
  CHECK(near > points.size() * 6 / 10);
}

TEST_CASE("cameras close together find what is many times their spread away") {
  // As of a light field: what lies beyond the depths that are guessed piles up at their end.
  const auto slope = [](const CameraRay& ray) {
    const glm::dvec3 normal(-0.8, 0.0, 0.6);
    const double t = (-0.8 - glm::dot(ray.origin, normal)) / glm::dot(ray.direction, normal);
    const glm::dvec3 p = ray.origin + t * ray.direction;
    return glm::dvec4(0.5 + 0.4 * std::sin(61 * p.y + 23 * p.z),
                      0.5 + 0.4 * std::cos(53 * p.z - 31 * p.y),
                      0.5 + 0.4 * std::sin(47 * p.y - 37 * p.z), 1.0);
  };
  std::vector<SmallPhoto> photos;
  for (int i = 0; i < 25; ++i) {
    const int row = i / 5;
    const glm::dvec3 eye(0, 0.05 * (i % 5 - 2), 0.05 * (row - 2));
    photos.push_back(
        photo_of(look_at(eye, eye + glm::dvec3(1, 0, 0), {0, 0, 1}, 96, 72, 110), slope));
  }
  const DepthRange depths = swept_depths(photos, 0.14, 3);
  CHECK(!depths.open);
  CHECK(depths.typical > 0.5);
  const PointCloud points = swept_points(photos, depths, 400, 0.25, 5).points;
  std::size_t near = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const float* p = points.positions.data() + 3 * i;
    near += std::abs(-0.8 * p[0] + 0.6 * p[2] + 0.8) < 0.1 ? 1 : 0;
  }
  MESSAGE(near << " of " << points.size() << " points on the slope, typically " << depths.typical);
  CHECK(near > points.size() * 6 / 10);
}

TEST_CASE("cameras side by side find the depth of the wall, however far away it was guessed") {
  // As from a drone: axes are parallel, and a photo shares its view with its next neighbours only.
  std::vector<SmallPhoto> photos;
  for (int i = 0; i < 25; ++i) {
    const int row = i / 5;
    const double y = 1.8 * (i % 5 - 2), z = 1.4 * (row - 2);
    photos.push_back(photo_of(look_at({0, y, z}, {4, y, z}, {0, 0, 1}, 96, 72, 90), wall));
  }
  for (const double guess : {4.0, 20.0}) {
    CAPTURE(guess);
    const DepthRange depths = swept_depths(photos, guess, 3);
    CHECK(!depths.open);
    CHECK(depths.typical > 3.5);
    CHECK(depths.typical < 6.5);
    const PointCloud points = swept_points(photos, depths, 400, 0.25, 5).points;
    std::size_t near = 0;
    for (std::size_t i = 0; i < points.size(); ++i)
      near += std::abs(points.positions[3 * i] - 4.0f) > 0.5f ? 0 : 1;
    MESSAGE(near << " of " << points.size() << " points on the wall");
    CHECK(near > points.size() * 6 / 10);
  }
}
