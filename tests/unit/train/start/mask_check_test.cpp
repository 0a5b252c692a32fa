// SPDX-License-Identifier: Apache-2.0
#include "train/start/mask_check.hpp"

#include <doctest/doctest.h>

#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <numeric>
#include <vector>

#include "unit/train/test_photos.hpp"
#include "util/rng.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

// Whether a mask keeps what a ray of a photo, by its number, shows.
using Keeps = std::function<bool(int, const CameraRay&)>;

double from_middle(const CameraRay& ray) {
  return glm::length(glm::cross(ray.direction, -ray.origin));
}

bool shows_ball(int, const CameraRay& ray) { return from_middle(ray) < 0.6; }
bool beside_ball(int photo, const CameraRay& ray) { return !shows_ball(photo, ray); }

// Somebody who stands in another place in each photo.
bool shows_walker(int photo, const CameraRay& ray) {
  const double angle = 2.4 * photo;
  const glm::dvec3 there = 1.2 * glm::dvec3(std::cos(angle), std::sin(angle), 0.3);
  return glm::length(glm::cross(ray.direction, there - ray.origin)) < 0.25;
}
bool beside_walker(int photo, const CameraRay& ray) { return !shows_walker(photo, ray); }

// Sixteen photos with masks.
struct Masked {
  explicit Masked(const Keeps& keeps, int count = 16) {
    const std::vector<Camera> cameras = ring(count, 3.0, {0, 0, 0});
    for (int i = 0; i < count; ++i) {
      const auto color = [&](const CameraRay& ray) {
        return glm::dvec4(0.5, 0.4, 0.3, keeps(i, ray) ? 1 : 0);
      };
      photos.push_back(photo_of(cameras[static_cast<std::size_t>(i)], color));
      View view;
      view.camera = photos.back().camera;
      view.mask_path = "mask.png";
      dataset.views.push_back(view);
    }
  }
  // Sparse points on the ball, or on the ground around it.
  Masked& with_points(bool on_ball) {
    CounterRng rng(5, 1);
    for (int i = 0; i < 300; ++i) {
      const double angle = 6.28 * rng.uniform(), far = on_ball ? 0.4 : 0.9 + 0.4 * rng.uniform();
      const double height = on_ball ? 0.6 * rng.uniform() - 0.3 : -0.5;
      for (const double p : {far * std::cos(angle), far * std::sin(angle), height})
        dataset.points.positions.push_back(static_cast<float>(p));
    }
    dataset.points.colors.resize(dataset.points.positions.size(), 0.5f);
    return *this;
  }
  MaskedOut found() const {
    std::vector<std::size_t> views(photos.size());
    std::iota(views.begin(), views.end(), std::size_t{0});
    return masked_out(dataset, photos, views, 1);
  }

  Dataset dataset;
  std::vector<SmallPhoto> photos;
};

}  // namespace

TEST_CASE("masks that keep a body or leave out who walks by are as they should be") {
  for (const bool on_ball : {false, true}) {
    // A bare body on a pattern has few points, and is what is wanted all the same.
    const MaskedOut body = Masked(shows_ball).with_points(on_ball).found();
    CHECK(body.agreed > 0.95);
    CHECK_FALSE(body.inverted());
    const MaskedOut walker = Masked(beside_walker).with_points(on_ball).found();
    CHECK(walker.points < 0.5);
    CHECK_FALSE(walker.inverted());
  }
  CHECK_FALSE(Masked(shows_ball).found().inverted());
  CHECK_FALSE(Masked(beside_ball).found().inverted());
  CHECK_FALSE(Masked(beside_walker).found().inverted());
}

TEST_CASE("masks that keep who walks by, or what is around the body, are inverted") {
  for (const bool on_ball : {false, true}) {
    const MaskedOut walker = Masked(shows_walker).with_points(on_ball).found();
    CHECK(walker.points > 0.75);
    CHECK(walker.agreed < 0.6);
    CHECK(walker.inverted());
  }
  const MaskedOut body = Masked(beside_ball).with_points(true).found();
  CHECK(body.points > 0.95);
  CHECK(body.edge < 0.5);
  CHECK(body.inverted());
  CHECK(Masked(shows_walker).found().inverted());
}

TEST_CASE("few photos, and those without masks, tell nothing of them") {
  CHECK_FALSE(Masked(shows_walker, 5).with_points(true).found().inverted());
  Masked bare = Masked(shows_walker).with_points(true);
  for (View& view : bare.dataset.views) view.mask_path.clear();
  CHECK(bare.found().seen == 0);
  CHECK_FALSE(bare.found().inverted());
}
