// SPDX-License-Identifier: Apache-2.0
#include "train/start/grey_photos.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <functional>
#include <vector>

#include "unit/train/test_photos.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

// What a ray of a photo, by its number, shows.
using Shows = std::function<glm::dvec4(int, const CameraRay&)>;
using Numbers = std::vector<std::size_t>;

glm::dvec4 colored(int, const CameraRay& ray) {
  const glm::dvec3 d = ray.direction;
  return {0.5 + 0.4 * std::sin(9 * d.x), 0.5 + 0.3 * std::cos(7 * d.y), 0.5 + 0.4 * d.z, 1};
}

glm::dvec4 grey(int photo, const CameraRay& ray) {
  const glm::dvec4 color = colored(photo, ray);
  const double light = 0.3 * color.r + 0.6 * color.g + 0.1 * color.b;
  return {light, light, light, 1};
}

Numbers found(const Shows& shows) {
  const std::vector<Camera> cameras = ring(12, 3.0, {0, 0, 0});
  std::vector<SmallPhoto> photos;
  photos.reserve(cameras.size());
  for (int i = 0; i < 12; ++i) {
    photos.push_back(photo_of(cameras[static_cast<std::size_t>(i)],
                              [&](const CameraRay& ray) { return shows(i, ray); }));
  }
  return grey_photos(photos);
}

// Photos of which some are grey.
Shows with_grey(const std::function<bool(int)>& is_grey) {
  return [=](int photo, const CameraRay& ray) {
    return is_grey(photo) ? grey(photo, ray) : colored(photo, ray);
  };
}

}  // namespace

TEST_CASE("grey photos among coloured ones are found, alone, in turn and as one half") {
  CHECK(found(with_grey([](int i) { return i == 7; })) == Numbers{7});
  CHECK(found(with_grey([](int i) { return i % 4 == 1; })) == Numbers{1, 5, 9});
  CHECK(found(with_grey([](int i) { return i >= 6; })) == Numbers{6, 7, 8, 9, 10, 11});
  CHECK(found(with_grey([](int i) { return i > 0; })).size() == 11);
}

TEST_CASE("captures that are coloured or grey throughout have no grey photos") {
  CHECK(found(colored).empty());
  CHECK(found(grey).empty());
}

TEST_CASE("a grey scene with something coloured has no grey photos") {
  // A red lamp that some photos show.
  CHECK(found([](int i, const CameraRay& ray) {
          const bool lamp = i % 2 == 0 && std::abs(ray.direction.z + 0.3) < 0.03;
          return lamp ? glm::dvec4(1, 0, 0, 1) : grey(i, ray);
        }).empty());
  // A wall on one side, of which photos show more the more they look there.
  CHECK(found([](int i, const CameraRay& ray) {
          return ray.direction.x > 0.2 ? colored(i, ray) : grey(i, ray);
        }).empty());
}

TEST_CASE("photos that show nothing are not grey, and those of one body count within it") {
  CHECK(found([](int i, const CameraRay& ray) {
          return i == 3 ? glm::dvec4(0, 0, 0, 1) : colored(i, ray);
        }).empty());
  CHECK(found([](int i, const CameraRay& ray) {
          return glm::dvec4(glm::dvec3(colored(i, ray)), i == 3 ? 0 : 1);
        }).empty());
}
