// SPDX-License-Identifier: Apache-2.0
#include "train/start/photo_start.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec4.hpp>
#include <memory>
#include <span>
#include <vector>

#include "scene/camera/camera_model.hpp"
#include "train/start/initialization.hpp"
#include "train/start/plane_sweep.hpp"
#include "train/start/point_cloud.hpp"
#include "unit/train/test_photos.hpp"
#include "util/rng.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

constexpr double kRadius = 0.5;
const glm::dvec3 kMiddle(0.2, -0.1, 0.3);

// An orange ball on transparent ground.
glm::dvec4 ball(const CameraRay& ray) {
  const glm::dvec3 to = kMiddle - ray.origin;
  const glm::dvec3 off = to - glm::dot(to, ray.direction) * ray.direction;
  return glm::length(off) < kRadius ? glm::dvec4(0.9, 0.5, 0.1, 1.0) : glm::dvec4(0.0);
}

std::vector<SmallPhoto> ring_of_ball() {
  std::vector<SmallPhoto> out;
  for (int i = 0; i < 16; ++i) {
    const double angle = 0.4 * i, height = i % 2 == 0 ? 1.5 : -1.2;
    out.push_back(photo_of(look_at({3 * std::cos(angle), 3 * std::sin(angle), height}, {0, 0, 0},
                                   {0, 0, 1}, 80, 80, 90),
                           ball));
  }
  return out;
}

}  // namespace

TEST_CASE("carving fills the body that the photos show, in its colour") {
  const std::vector<SmallPhoto> photos = ring_of_ball();
  CHECK(opaque_share(photos) > 0.05);
  CHECK(opaque_share(photos) < 0.4);
  const Region region{{0, 0, 0}, 1.2};
  const PointCloud points = carved_points(photos, region, 500, 7);
  REQUIRE(points.size() == 500);
  CHECK(points.positions == carved_points(photos, region, 500, 7).positions);
  CHECK(points.positions != carved_points(photos, region, 500, 8).positions);
  double volume = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const float* p = points.positions.data() + 3 * i;
    const double distance = glm::distance(glm::dvec3(p[0], p[1], p[2]), kMiddle);
    // A pixel is 0.04 wide there; the hull of 16 views is a little larger than the ball.
    CHECK(distance < 1.35 * kRadius);
    volume += distance < kRadius ? 1.0 : 0.0;
    CHECK(points.colors[3 * i] == doctest::Approx(0.9).epsilon(0.02));
    CHECK(points.colors[3 * i + 2] == doctest::Approx(0.1).epsilon(0.05));
  }
  CHECK(volume > 300);
  CHECK(carved_points(photos, {{9, 9, 9}, 0.1}, 10, 7).size() == 0);
}

TEST_CASE("a body that is half transparent all over counts as a body") {
  std::vector<SmallPhoto> photos = ring_of_ball();
  const double body = body_share(photos), range = color_range(photos);
  CHECK(body == doctest::Approx(opaque_share(photos)).epsilon(0.01));
  for (SmallPhoto& photo : photos) {
    auto veiled = std::make_shared<io::Photo>(*photo.picture);
    for (std::uint32_t& word : veiled->words) word = (word & 0xffffffu) | (word >> 25) << 24;
    photo.picture = veiled;
  }
  CHECK(opaque_share(photos) == 0);
  CHECK(body_share(photos) == doctest::Approx(body).epsilon(0.25));  // without its outline
  CHECK(color_range(photos) == doctest::Approx(range).epsilon(0.02));
  const PointCloud points = carved_points(photos, {{0, 0, 0}, 1.2}, 100, 7);
  REQUIRE(points.size() == 100);
  for (std::size_t i = 0; i < points.size(); ++i) {
    CHECK(points.colors[3 * i] == doctest::Approx(0.9).epsilon(0.02));
    CHECK(points.colors[3 * i + 2] == doctest::Approx(0.1).epsilon(0.05));
  }
}

TEST_CASE("points that cut-out photos show as background are left out") {
  const std::vector<SmallPhoto> photos = ring_of_ball();
  PointCloud points;
  const auto add = [&points](const glm::dvec3& place, float red) {
    for (int a = 0; a < 3; ++a) {
      points.positions.push_back(static_cast<float>(place[a]));
      points.colors.push_back(a == 0 ? red : 0.25f);
    }
  };
  add(kMiddle, 0.1f);
  add(kMiddle + glm::dvec3(0, 0, 0.95 * kRadius), 0.2f);
  add(kMiddle + glm::dvec3(0, 0, 2 * kRadius), 0.3f);  // outside
  add({0, 0, -1.5}, 0.4f);                             // the table
  add({900, 0, 0}, 0.5f);                              // nobody looks there
  const PointCloud hull = hull_points(points, photos);
  REQUIRE(hull.size() == 2);
  CHECK(hull.positions[5] == points.positions[5]);
  CHECK(hull.colors[3] == 0.2f);
}

TEST_CASE("points that masks hide from most photos are left out of a start") {
  // A body in the middle, of which masks leave out what is around it.
  std::vector<SmallPhoto> photos;
  const auto masked = [](const CameraRay& ray) {
    const double along = -glm::dot(ray.origin, ray.direction);
    const bool body = glm::length(ray.origin + along * ray.direction) < 0.5;
    return glm::dvec4(0.5, 0.5, 0.5, body ? 1.0 : 0.0);
  };
  std::vector<Camera> cameras = ring(12, 4, {0, 0, 0});
  for (Camera& camera : cameras) {
    camera.fx = camera.fy = 40;
    photos.push_back(photo_of(camera, masked));
  }
  PointCloud points;
  append_point(points, {0.1, 0, 0}, glm::dvec3(0.5));
  append_point(points, {0, 0.3, -0.2}, glm::dvec3(0.5));
  append_point(points, {0, 0, 900}, glm::dvec3(0.5));  // nobody looks there
  append_point(points, {1.5, 0, 0}, glm::dvec3(0.5));  // beside the body
  append_point(points, {0, -3, -1}, glm::dvec3(0.5));  // behind it
  const PointCloud counted = counted_points(points, photos);
  REQUIRE(counted.size() == 3);
  CHECK(counted.positions[8] == 900.0f);
  // Three photos are too few, and what hides a place in some of them hides no point.
  CHECK(counted_points(points, std::span(photos).first(3)).size() == 5);
  for (std::size_t i = 0; i < photos.size(); i += 2)
    photos[i] = photo_of(cameras[i], [](const CameraRay&) { return glm::dvec4(0.5, 0.5, 0.5, 1); });
  CHECK(counted_points(points, photos).size() == 5);
  for (std::size_t i = 0; i < photos.size(); i += 2) photos[i] = photo_of(cameras[i], masked);
  // As a start takes them.
  Dataset dataset;
  dataset.views.resize(1);
  dataset.views[0].mask_path = "mask.png";
  CounterRng rng(3, 0);
  for (int i = 0; i < 3000; ++i) {
    const double far = i % 2 == 0 ? 0.25 : 1.5;
    const double angle = 6.28 * rng.uniform();
    append_point(dataset.points,
                 {far * std::cos(angle), far * std::sin(angle), 0.2 * rng.uniform()},
                 glm::dvec3(0.5));
  }
  const Gaussians model = initial_model(
      dataset, cameras, [&](PhotoChoice) -> const auto& { return photos; }, 10000, {});
  CHECK(model.size() == 1500);
  for (std::size_t i = 0; i < model.size(); ++i)
    CHECK(std::hypot(model.means[3 * i], model.means[3 * i + 1]) < 0.3);
}

TEST_CASE("the range of colours is that of the widest channel, without the few pixels beyond") {
  const auto ramp = [](double low, double high) {
    return [low, high](const CameraRay& ray) {
      const double x = 0.5 * (1 + ray.direction.y / ray.direction.x);
      if (ray.direction.z > 0.7) return glm::dvec4(0, 0, 1, 0);  // nothing there
      return glm::dvec4(low + (high - low) * std::clamp(x, 0.0, 1.0), 0.3, 0.3, 1);
    };
  };
  const Camera camera = look_at({0, 0, 0}, {4, 0, 0}, {0, 0, 1}, 100, 100, 50);
  std::vector<SmallPhoto> photos{photo_of(camera, ramp(0.2, 0.3)),
                                 photo_of(camera, ramp(0.2, 0.3))};
  CHECK(color_range(photos) == doctest::Approx(0.098).epsilon(0.03));
  photos[1].gain = {3.0f, 1.0f, 1.0f};  // as balance() says
  CHECK(color_range(photos) == doctest::Approx(0.69).epsilon(0.03));
  CHECK(color_range({}) == doctest::Approx(1.0 / 255));
  photos = {photo_of(camera, ramp(0.4, 0.4))};
  CHECK(color_range(photos) == doctest::Approx(1.0 / 255));
}

TEST_CASE("photos of other exposures agree once they are balanced") {
  std::vector<SmallPhoto> photos;
  for (int i = 0; i < 9; ++i) {
    const double y = 0.4 * (i % 3 - 1), z = 0.4 * (i / 3 - 1);
    const double gain = 0.4 + 1.2 * (i * 4 % 9) / 8.0;
    const auto exposed = [gain](const CameraRay& ray) {
      return wall(ray) * glm::dvec4(0.6 * gain, 0.6 * gain, 0.6 * gain, 1);
    };
    photos.push_back(
        photo_of(look_at({0, y, z}, {4, 0.5 * y, 0.5 * z}, {0, 0, 1}, 96, 72, 90), exposed));
  }
  const auto on_the_wall = [&photos] {
    const PointCloud points = swept_points(photos, {0.6, 3.0, 30.0}, 400, 0.25, 5).points;
    std::size_t near = 0;
    for (std::size_t i = 0; i < points.size(); ++i)
      near += std::abs(points.positions[3 * i] - 4.0f) > 0.5f ? 0 : 1;
    return near;
  };
  const std::size_t before = on_the_wall();
  const auto plain = typical_color(photos);
  balance(photos);
  for (std::size_t i = 0; i < photos.size(); ++i) {
    const double gain = 0.4 + 1.2 * static_cast<double>(i * 4 % 9) / 8.0;
    CHECK(static_cast<double>(photos[i].gain[1]) * gain == doctest::Approx(1.0).epsilon(0.05));
  }
  const std::size_t after = on_the_wall();
  MESSAGE(before << " points on the wall, " << after << " once balanced");
  CHECK(after > 240);
  CHECK(after > before + 50);
  for (std::size_t c = 0; c < 3; ++c)
    CHECK(typical_color(photos)[c] == doctest::Approx(plain[c]).epsilon(0.01));
  const auto gain = photos[3].gain;
  balance(photos);  // they are
  CHECK(photos[3].gain[0] == doctest::Approx(gain[0]).epsilon(1e-4));
}

TEST_CASE("lamps at night set the range of colours, a speck does not") {
  const Camera camera = look_at({0, 0, 0}, {4, 0, 0}, {0, 0, 1}, 100, 100, 100);
  // White within so many pixels of the middle.
  const auto night = [&camera](double radius) {
    return std::vector{photo_of(camera, [&](const CameraRay& ray) {
      const double off = 100.0 * std::hypot(ray.direction.y, ray.direction.z) / ray.direction.x;
      return glm::dvec4(glm::dvec3(off < radius ? 1.0 : 0.01), 1.0);
    })};
  };
  CHECK(color_range(night(3.6)) > 0.9);  // 40 of 10 000 pixels
  CHECK(color_range(night(1.0)) < 0.02);
}

TEST_CASE("a random start fills the region and what the photos see, in their colours") {
  const Region region{{1, 2, 3}, 0.5};
  const std::vector<SmallPhoto> photos = photos_of_wall();
  const DepthRange depths = depths_around(3.0);
  const PointCloud points = scattered_points(photos, region, depths, 2000, 3);
  REQUIRE(points.size() == 2000);
  CHECK(points.positions == scattered_points(photos, region, depths, 2000, 3).positions);
  CHECK(points.positions != scattered_points(photos, region, depths, 2000, 4).positions);
  std::size_t inside = 0, seen = 0, near = 0, coloured = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const float* p = points.positions.data() + 3 * i;
    const glm::dvec3 place(p[0], p[1], p[2]);
    const glm::dvec3 off = glm::abs(place - region.center);
    inside += std::max({off.x, off.y, off.z}) <= region.half_side ? 1 : 0;
    double least = 1e9;
    for (const SmallPhoto& photo : photos) {
      if (photo.sees(place)) least = std::min(least, glm::distance(place, photo.camera.center()));
    }
    if (least > 1e8) {
      for (int c = 0; c < 3; ++c) CHECK(points.colors[3 * i + static_cast<std::size_t>(c)] == 0.5f);
      continue;
    }
    ++seen;
    CHECK(least <= 30.001);
    near += least < std::sqrt(0.6 * 30.0) ? 1 : 0;
    coloured += points.colors[3 * i] != 0.5f ? 1 : 0;
  }
  MESSAGE(inside << " in the region, " << seen << " seen, " << near << " of them near");
  CHECK(inside > 950);
  CHECK(inside < 1100);
  CHECK(seen > 950);
  CHECK(near > 400);
  CHECK(near < 1100);
  CHECK(coloured > seen * 9 / 10);
  // Without photos the region alone, evenly and grey.
  const PointCloud grey = scattered_points({}, region, depths, 1000, 3);
  double low = 1e9, high = -1e9, mean = 0;
  for (std::size_t i = 0; i < 1000; ++i) {
    low = std::min<double>(low, grey.positions[3 * i + 1]);
    high = std::max<double>(high, grey.positions[3 * i + 1]);
    mean += grey.positions[3 * i + 1] / 1000.0;
  }
  CHECK(low >= 1.5);
  CHECK(high <= 2.5);
  CHECK(low < 1.52);
  CHECK(high > 2.48);
  CHECK(mean == doctest::Approx(2.0).epsilon(0.02));
  CHECK(std::ranges::all_of(grey.colors, [](float c) { return c == 0.5f; }));
}

TEST_CASE("few sparse points get company from the photos, up to the limit") {
  Dataset dataset;
  const std::vector<SmallPhoto> photos = photos_of_wall();
  std::vector<Camera> cameras;
  for (const SmallPhoto& photo : photos) cameras.push_back(photo.camera);
  for (int i = 0; i < 60; ++i) {
    dataset.points.positions.insert(dataset.points.positions.end(),
                                    {4.0f, 0.01f * static_cast<float>(i), 0.1f});
    dataset.points.colors.insert(dataset.points.colors.end(), {0.5f, 0.5f, 0.5f});
  }
  TrainOptions options;
  const auto first = [&](std::size_t limit) {
    return initial_model(
               dataset, cameras, [&photos](PhotoChoice) -> const auto& { return photos; }, limit,
               options)
        .size();
  };
  CHECK(first(1000) > 60 + 200);
  options.init_count = 500;
  CHECK(first(500) > 400);
  CHECK(first(500) <= 500);
  options.init = "colmap";
  CHECK(first(1000) == 60);
}

TEST_CASE("however small the limit, photos give a start") {
  Dataset dataset;
  std::vector<SmallPhoto> photos = photos_of_wall();
  std::vector<Camera> cameras;
  for (const SmallPhoto& photo : photos) cameras.push_back(photo.camera);
  const auto first = [&](std::size_t limit) {
    return initial_model(dataset, cameras, [&photos](PhotoChoice) -> const auto& { return photos; },
                         limit, {})
        .size();
  };
  // In place of points that no photo sees.
  for (int i = 0; i < 60; ++i) {
    dataset.points.positions.insert(dataset.points.positions.end(),
                                    {-10.0f, 0.01f * static_cast<float>(i), 0.1f});
    dataset.points.colors.insert(dataset.points.colors.end(), {0.5f, 0.5f, 0.5f});
  }
  for (const std::size_t limit : {1u, 3u, 6u, 10u}) {
    CAPTURE(limit);
    CHECK(first(limit) > 0);
    CHECK(first(limit) <= limit);
  }
  // Where they are of one colour, which tells no depth.
  dataset.points = {};
  for (SmallPhoto& photo : photos)
    photo = photo_of(photo.camera, [](const CameraRay&) { return glm::dvec4(0.3, 0.5, 0.2, 1); });
  for (const std::size_t limit : {1u, 3u, 6u, 10u}) {
    CAPTURE(limit);
    CHECK(first(limit) > 0);
    CHECK(first(limit) <= limit);
  }
}
