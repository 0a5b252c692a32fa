// SPDX-License-Identifier: Apache-2.0
#include "train/start/still_marks.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <utility>
#include <vector>

#include "train/start/still_ground.hpp"
#include "unit/train/test_photos.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

constexpr int kWidth = 400, kHeight = 300;

// What a pixel of a photo shows.
using Shows = std::function<glm::dvec4(const CameraRay&, int x, int y)>;

glm::dvec4 pattern(const CameraRay& ray, int, int) {
  const glm::dvec3 d = ray.direction;
  return {0.5 + 0.3 * std::sin(19 * d.x + 3 * d.z), 0.5 + 0.3 * std::cos(17 * d.y - 5 * d.x),
          0.5 + 0.3 * std::sin(23 * d.z + 7 * d.y), 1};
}

// Letters, 12 pixels high, from (300, 270) on.
bool is_letter(int x, int y) {
  if (x < 300 || x >= 360 || y < 270 || y >= 282) return false;
  const int u = (x - 300) % 10, v = y - 270;
  return u < 2 || (u < 7 && (v < 2 || v >= 10));
}

glm::dvec4 dated(const CameraRay& ray, int x, int y) {
  return is_letter(x, y) ? glm::dvec4(1, 1, 1, 1) : pattern(ray, x, y);
}

std::vector<Camera> around(int count, double height = 1.2) {
  std::vector<Camera> cameras;
  for (int i = 0; i < count; ++i) {
    const double angle = 6.283 * i / count;
    cameras.push_back(look_at({3 * std::cos(angle), 3 * std::sin(angle), height}, {0, 0, 0},
                              {0, 0, 1}, kWidth, kHeight, 400));
  }
  return cameras;
}

std::vector<SmallPhoto> photos_by(const std::vector<Camera>& cameras, const Shows& shows) {
  std::vector<SmallPhoto> photos;
  for (const Camera& camera : cameras) {
    int pixel = 0;
    photos.push_back(photo_of(camera, [&](const CameraRay& ray) {
      const int x = pixel % kWidth, y = pixel / kWidth;
      ++pixel;
      return shows(ray, x, y);
    }));
  }
  return photos;
}

std::vector<StillMark> found(const std::vector<Camera>& cameras, const Shows& shows) {
  return still_marks(photos_by(cameras, shows));
}

// A body that turned before a ground, which is another for each height of the camera.
glm::dvec4 on_turntable(const CameraRay& ray, int x, int y) {
  const double turned = ray.origin.z > 2 ? 0.7 : 0.0;
  const double wave = 0.5 + 0.4 * std::sin(0.3 * x + turned * y) * std::sin(0.3 * y + 3 * turned);
  const bool body = x > 130 && x < 270 && y > 60;
  return body ? pattern(ray, x, y) : glm::dvec4(wave, wave, wave, 1);
}

}  // namespace

TEST_CASE("a date that all photos have at the same pixels is a mark, and a scene has none") {
  const std::vector<StillMark> marks = found(around(16), dated);
  REQUIRE(marks.size() == 1);
  CHECK(std::abs(marks[0].low.x - 300) <= 1);
  CHECK(std::abs(marks[0].high.x - 357) <= 2);
  CHECK(std::abs(marks[0].low.y - 270) <= 1);
  CHECK(std::abs(marks[0].high.y - 281) <= 1);
  // Its pixels are those of the photos that have it, whatever comes first.
  std::vector<Camera> mixed = around(16);
  std::swap(mixed.front().width, mixed.front().height);
  const std::vector<StillMark> again = found(mixed, dated);
  REQUIRE(again.size() == 1);
  CHECK(again[0].size == glm::ivec2(kWidth, kHeight));
  CHECK(found(around(16), pattern).empty());
}

TEST_CASE("few photos, and those whose masks leave a mark out, tell of none") {
  CHECK(found(around(11), dated).empty());
  CHECK(found(around(16), [](const CameraRay& ray, int x, int y) {
          const bool masked = x > 295 && x < 365 && y > 265 && y < 287;
          return glm::dvec4(glm::dvec3(dated(ray, x, y)), masked ? 0 : 1);
        }).empty());
}

TEST_CASE(
    "what all cameras look at, and what is far away from those that do not turn, is no mark") {
  // A white ball in the middle of an orbit.
  CHECK(found(around(16), [](const CameraRay& ray, int x, int y) {
          const bool ball = glm::length(glm::cross(ray.direction, -ray.origin)) < 0.15;
          return ball ? glm::dvec4(1, 1, 1, 1) : pattern(ray, x, y);
        }).empty());
  std::vector<Camera> row;
  for (int i = 0; i < 16; ++i) {
    const double y = 0.1 * i;
    row.push_back(look_at({0, y, 0}, {4, y, 0}, {0, 0, 1}, kWidth, kHeight, 400));
  }
  CHECK(found(row, [](const CameraRay& ray, int x, int y) {
          if (is_letter(x, y)) return glm::dvec4(1, 1, 1, 1);
          const double t = (4.0 - ray.origin.x) / ray.direction.x;
          const glm::dvec3 near = ray.origin + t * ray.direction;
          return pattern({{}, glm::dvec3(1, near.y, near.z), true}, x, y);
        }).empty());
}

TEST_CASE("a ground that stays where it is behind a turntable is no small mark") {
  CHECK(found(around(16), [](const CameraRay& ray, int x, int y) {
          const bool ground = y < 120;
          const double wave = 0.5 + 0.4 * std::sin(0.3 * x) * std::sin(0.3 * y);
          return ground ? glm::dvec4(wave, wave, wave, 1) : pattern(ray, x, y);
        }).empty());
  // Nor is one of one colour.
  CHECK(found(around(16), [](const CameraRay& ray, int x, int y) {
          return y < 120 ? glm::dvec4(1, 1, 1, 1) : pattern(ray, x, y);
        }).empty());
}

TEST_CASE("a ground that does not turn with a turntable is told, of two heights too") {
  const auto ground = still_ground(photos_by(around(16), on_turntable));
  REQUIRE(ground.has_value());
  CHECK(ground->photos == 16);
  CHECK(ground->edges > 0.3);
  std::vector<Camera> two = around(8);
  for (const Camera& camera : around(8, 3.0)) two.push_back(camera);
  const auto half = still_ground(photos_by(two, on_turntable));
  REQUIRE(half.has_value());
  CHECK(half->photos == 8);
}

TEST_CASE("a ground is told whichever photo is unlike the others") {
  for (const std::size_t odd : {std::size_t{0}, std::size_t{7}}) {
    CAPTURE(odd);
    std::vector<SmallPhoto> photos = photos_by(around(16), on_turntable);
    // A hand before most of the ground.
    photos[odd] = photos_by({photos[odd].camera}, [](const CameraRay& ray, int x, int y) {
                    return x < 330 ? pattern(ray, x, y) : on_turntable(ray, x, y);
                  }).front();
    const auto ground = still_ground(photos);
    REQUIRE(ground.has_value());
    CHECK(ground->photos >= 15);
    CHECK(ground->edges > 0.3);
  }
}

TEST_CASE("what is round looks the same from all sides and is no ground") {
  const auto vase = [](const CameraRay&, int x, int y) {
    const double across = x - 200;
    const bool body = std::abs(across) < 70 && y > 60;
    const bool groove = static_cast<int>((y - 0.002 * across * across) / 20) % 2 == 0;
    return glm::dvec4(glm::dvec3(body ? (groove ? 0.3 : 0.6) : 0.9), 1);
  };
  const auto plate = [](const CameraRay&, int x, int y) {
    const double radius = std::hypot(x - 200.0, (y - 150.0) / 0.4);
    const bool ring = static_cast<int>(radius / 15) % 2 == 0;
    return glm::dvec4(glm::dvec3(radius < 180 ? (ring ? 0.3 : 0.6) : 0.9), 1);
  };
  CHECK_FALSE(still_ground(photos_by(around(16), vase)).has_value());
  CHECK_FALSE(still_ground(photos_by(around(16), plate)).has_value());
}

TEST_CASE("no ground stands still around a camera that moves, beside masks, or that is plain") {
  CHECK_FALSE(still_ground(photos_by(around(16), pattern)).has_value());
  CHECK_FALSE(still_ground(photos_by(around(16), dated)).has_value());
  CHECK_FALSE(still_ground(photos_by(around(16), [](const CameraRay& ray, int x, int y) {
                const bool body = x > 130 && x < 270 && y > 60;
                return glm::dvec4(glm::dvec3(on_turntable(ray, x, y)), body ? 1 : 0);
              })).has_value());
  CHECK_FALSE(still_ground(photos_by(around(16), [](const CameraRay& ray, int x, int y) {
                const bool body = x > 130 && x < 270 && y > 60;
                return body ? pattern(ray, x, y) : glm::dvec4(0.8, 0.8, 0.8, 1);
              })).has_value());
  // Cameras that do not move see everything at the same pixels.
  CHECK_FALSE(
      still_ground(photos_by(std::vector<Camera>(16, around(1).front()), pattern)).has_value());
}

TEST_CASE("the area of a mark is that of the photo, whose lens may bend it") {
  const StillMark mark{{300, 270}, {359, 281}, 80, {kWidth, kHeight}};
  Camera picture = around(1).front();
  const PhotoArea same = area_of(mark, picture, picture);
  CHECK(same.left == doctest::Approx(298.0 / kWidth).epsilon(0.003));
  CHECK(same.right == doctest::Approx(362.0 / kWidth).epsilon(0.003));
  CHECK(same.top == doctest::Approx(268.0 / kHeight).epsilon(0.003));
  CHECK(same.bottom == doctest::Approx(284.0 / kHeight).epsilon(0.003));
  // A photo of twice the size through a lens that pulls its corners in.
  Camera photo = picture;
  photo.width *= 2, photo.height *= 2;
  photo.fx *= 2, photo.fy *= 2, photo.cx *= 2, photo.cy *= 2;
  photo.model = CameraModel::kOpenCv;
  photo.distortion.k1 = -0.2;
  const PhotoArea bent = area_of(mark, picture, photo);
  CHECK(bent.right < same.right);
  CHECK(bent.bottom < same.bottom);
  for (const double x : {298.0, 330.0, 362.0}) {
    for (const double y : {268.0, 276.0, 284.0}) {
      const CameraRay ray = camera_ray(picture, x, y);
      const auto seen = project(photo, ray.origin + ray.direction);
      REQUIRE(seen.has_value());
      CHECK(seen->x >= bent.left * photo.width - 1e-9);
      CHECK(seen->x <= bent.right * photo.width + 1e-9);
      CHECK(seen->y >= bent.top * photo.height - 1e-9);
      CHECK(seen->y <= bent.bottom * photo.height + 1e-9);
    }
  }
}

TEST_CASE("the area of a mark ends with the picture, panoramas too") {
  const StillMark corner{{0, 280}, {59, 299}, 80, {kWidth, kHeight}};
  Camera camera = around(1).front();
  for (const CameraModel model : {CameraModel::kPinhole, CameraModel::kEquirectangular}) {
    CAPTURE(static_cast<int>(model));
    if (model == CameraModel::kEquirectangular) set_equirectangular(camera);
    const PhotoArea area = area_of(corner, camera, camera);
    CHECK(area.left == doctest::Approx(0.0));
    CHECK(area.right == doctest::Approx(62.0 / kWidth).epsilon(0.003));
    CHECK(area.top == doctest::Approx(278.0 / kHeight).epsilon(0.003));
    CHECK(area.bottom == doctest::Approx(1.0));
  }
}
