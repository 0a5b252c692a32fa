// SPDX-License-Identifier: Apache-2.0
#include "train/start/point_check.hpp"

#include <doctest/doctest.h>

#include <array>
#include <vector>

#include "scene/camera/camera_model.hpp"
#include "scene/statistics.hpp"
#include "train/start/initialization.hpp"
#include "train/start/photo_start.hpp"
#include "train/start/plane_sweep.hpp"
#include "train/start/point_cloud.hpp"
#include "train/start/point_cover.hpp"
#include "unit/train/test_photos.hpp"
#include "util/rng.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

std::vector<Camera> cameras_of(const std::vector<SmallPhoto>& photos) {
  std::vector<Camera> out;
  out.reserve(photos.size());
  for (const SmallPhoto& photo : photos) out.push_back(photo.camera);
  return out;
}

// Points on the wall with its colours, moved by `moved` from (x, y, z) afterwards.
template <class Moved>
PointCloud points_of_wall(const Moved& moved) {
  CounterRng rng(3, 1);
  PointCloud out;
  for (int i = 0; i < 3000; ++i) {
    const glm::dvec3 p(4.0, 3.0 * rng.uniform() - 1.5, 2.4 * rng.uniform() - 1.2);
    const glm::dvec4 color = wall({{0, 0, 0}, p / 4.0, true});
    const glm::dvec3 place = moved(p);
    for (int k = 0; k < 3; ++k) {
      out.positions.push_back(static_cast<float>(place[k]));
      out.colors.push_back(static_cast<float>(color[k]));
    }
  }
  return out;
}

}  // namespace

TEST_CASE("points in other units or axes than the cameras are told from those in place") {
  const std::vector<SmallPhoto> photos = photos_of_wall();
  const std::vector<Camera> cameras = cameras_of(photos);
  const auto match = [&](const auto& moved) {
    return match_points(points_of_wall(moved), cameras, photos);
  };
  const PointMatch sound = match([](const glm::dvec3& p) { return p; });
  CHECK(sound.seen > 0.9);
  REQUIRE(sound.difference);
  CHECK(*sound.difference < 0.1);
  CHECK(plausible(sound));
  for (const double scale : {0.25, 0.5, 2.0, 10.0, 1000.0}) {
    CAPTURE(scale);
    CHECK(!plausible(match([&](const glm::dvec3& p) { return scale * p; })));
  }
  CHECK(!plausible(match([](const glm::dvec3& p) { return glm::dvec3(p.y, p.x, p.z); })));
  CHECK(!plausible(match([](const glm::dvec3& p) { return glm::dvec3(p.x, p.z, -p.y); })));
  CHECK(!plausible(match([](const glm::dvec3& p) { return -p; })));
  const PointMatch larger = match([](const glm::dvec3& p) { return 4.0 * p; });
  CHECK(larger.scale == doctest::Approx(0.25));
  CHECK(larger.scaled_difference < 0.2 * *larger.difference);
}

TEST_CASE("points in place are believed at night, though smaller ones lie on as much black") {
  // Lamps on a wall that is all but black.
  const auto night = [](const CameraRay& ray) {
    const double t = (4.0 - ray.origin.x) / ray.direction.x;
    const glm::dvec3 p = ray.origin + t * ray.direction;
    const glm::dvec2 apart(std::remainder(p.y, 0.9), std::remainder(p.z - 0.4, 0.9));
    const double light = glm::length(apart) < 0.06 ? 1.0 : 0.0;
    return glm::max(glm::dvec4(light, light, light, 1.0), 0.02 * wall(ray));
  };
  std::vector<SmallPhoto> photos;
  for (const SmallPhoto& photo : photos_of_wall()) photos.push_back(photo_of(photo.camera, night));
  PointCloud points = points_of_wall([](const glm::dvec3& p) { return p; });
  for (std::size_t i = 0; i < points.size(); ++i) {
    const float* p = points.positions.data() + 3 * i;
    const glm::dvec4 color = night({{0, 0, 0}, glm::dvec3(p[0], p[1], p[2]) / 4.0, true});
    for (int k = 0; k < 3; ++k) points.colors[3 * i + k] = static_cast<float>(color[k]);
  }
  const PointMatch match = match_points(points, cameras_of(photos), photos);
  REQUIRE(match.difference);
  MESSAGE("differs by " << *match.difference << ", and by " << match.scaled_difference << " at "
                        << match.scale << " times the size");
  CHECK(plausible(match));
  // As in a capture of such lamps.
  CHECK(plausible({1.0, 0.07, 0.0625, 0.01}));
  CHECK_FALSE(plausible({1.0, 0.5, 0.25, 0.05}));
}

TEST_CASE("points without colours, or that few photos see, are believed") {
  const std::vector<SmallPhoto> photos = photos_of_wall();
  const std::vector<Camera> cameras = cameras_of(photos);
  PointCloud grey = points_of_wall([](const glm::dvec3& p) { return 2.0 * p; });
  grey.colors.assign(grey.colors.size(), 0.5f);
  const PointMatch match = match_points(grey, cameras, photos);
  CHECK(!match.difference);
  CHECK(plausible(match));
  const PointCloud sound = points_of_wall([](const glm::dvec3& p) { return p; });
  CHECK(!match_points(sound, cameras, {}).difference);
  CHECK(plausible(match_points(sound, cameras, {})));
  CHECK(match_points({}, cameras, photos).seen == 0);
}

TEST_CASE("points of a scan that lie behind what photos show are believed") {
  const std::vector<SmallPhoto> photos = photos_of_wall();
  const std::vector<Camera> cameras = cameras_of(photos);
  PointCloud scan = points_of_wall([](const glm::dvec3& p) { return p; });
  CounterRng rng(7, 1);
  for (int i = 0; i < 9000; ++i) {
    const glm::dvec3 p(5.0 + 4.0 * rng.uniform(), 4.0 * rng.uniform() - 2.0,
                       3.0 * rng.uniform() - 1.5);
    append_point(scan, p, {rng.uniform(), rng.uniform(), rng.uniform()});
  }
  const PointMatch match = match_points(scan, cameras, photos);
  REQUIRE(match.difference);
  MESSAGE("differs by " << *match.difference);
  CHECK(*match.difference < 0.3);
  CHECK(plausible(match));
}

TEST_CASE("points of one colour start with the photos' colours") {
  const std::vector<SmallPhoto> photos = photos_of_wall();
  const std::vector<Camera> cameras = cameras_of(photos);
  const PointCloud sound = points_of_wall([](const glm::dvec3& p) { return p; });
  CHECK(!colorless(sound));
  PointCloud black = sound;
  black.colors.assign(black.colors.size(), 0.0f);
  CHECK(colorless(black));
  const PointCloud found = colored_by_photos(black, photos);
  double difference = 0;
  for (std::size_t i = 0; i < sound.colors.size(); ++i) {
    difference += std::abs(static_cast<double>(found.colors[i] - sound.colors[i])) /
                  static_cast<double>(sound.colors.size());
  }
  CHECK(difference < 0.03);
  Dataset dataset;
  dataset.points = black;
  const Gaussians model = initial_model(
      dataset, cameras, [&photos](PhotoChoice) -> const auto& { return photos; }, 1000, {});
  CHECK(*std::max_element(model.sh.begin(), model.sh.end()) > 0.5f);
}

TEST_CASE("points on a small part of what photos show are joined by points of the photos") {
  const std::vector<SmallPhoto> photos = photos_of_wall();
  const std::vector<Camera> cameras = cameras_of(photos);
  const PointCloud sound = points_of_wall([](const glm::dvec3& p) { return p; });
  CHECK(bare_share(sound, photos) < 0.3);
  CHECK(bare_share({}, photos) == 1.0);
  const auto place = [](const glm::dvec3& p) { return glm::dvec3(p.x, 0.1 * p.y, 0.1 * p.z); };
  PointCloud small = points_of_wall(place);
  for (std::size_t i = 0; i < small.size(); ++i) {
    const glm::dvec3 p(small.positions[3 * i], small.positions[3 * i + 1],
                       small.positions[3 * i + 2]);
    const glm::dvec4 color = wall({{0, 0, 0}, p / 4.0, true});
    for (int k = 0; k < 3; ++k)
      small.colors[3 * i + static_cast<std::size_t>(k)] = static_cast<float>(color[k]);
  }
  CHECK(bare_share(small, photos) > 0.8);
  Dataset dataset;
  dataset.points = small;
  TrainOptions options;
  const auto model = [&] {
    return initial_model(
        dataset, cameras, [&photos](PhotoChoice) -> const auto& { return photos; }, 4000, options);
  };
  const auto spread = [](const Gaussians& of) {
    double most = 0;
    for (std::size_t i = 0; i < of.size(); ++i)
      most = std::max(most, std::abs(static_cast<double>(of.means[3 * i + 1])));
    return most;
  };
  CHECK(spread(model()) > 0.5);
  // Where photos are not asked what they tell of depth, their bare places say it.
  options.photo_points = false;
  CHECK(spread(model()) > 0.5);
  // What a box leaves out lacks no points: the start is of the sparse ones alone.
  options.bounds = Bounds{{3.0, -0.2, -0.2}, {5.0, 0.2, 0.2}};
  CHECK(model().size() == 2000);
  options = {};
  options.init = "colmap";
  CHECK(spread(model()) < 0.16);
}

TEST_CASE("a white wall without points is no part that lacks them") {
  // Above, the wall is white in one set of photos.
  const auto white_above = [](const CameraRay& ray) {
    const double t = (4.0 - ray.origin.x) / ray.direction.x;
    return ray.origin.z + t * ray.direction.z > 0.0 ? glm::dvec4(0.9, 0.9, 0.9, 1.0) : wall(ray);
  };
  const std::vector<SmallPhoto> photos = photos_of_wall();
  std::vector<SmallPhoto> white;
  white.reserve(photos.size());
  for (const SmallPhoto& photo : photos) white.push_back(photo_of(photo.camera, white_above));
  const PointCloud below = points_below(0.0);
  const double lacking = bare_share(below, photos), plain = bare_share(below, white);
  MESSAGE(lacking << " of a textured wall, " << plain << " of a white one");
  CHECK(lacking > 0.31);
  CHECK(plain < 0.15);
}

TEST_CASE("points of photos that tell of depth stand beside sparse ones, in their places") {
  std::vector<SmallPhoto> photos = photos_of_wall();
  const std::vector<Camera> cameras = cameras_of(photos);
  const PointCloud found = swept_points(photos, {0.6, 3.0, 30.0}, 400, 0.0, 5).points;
  const auto count_above = [](double height, const PointCloud& points) {
    std::size_t above = 0;
    for (std::size_t i = 0; i < points.size(); ++i)
      above += points.positions[3 * i + 2] > height ? 1 : 0;
    return above;
  };
  const PointCloud most = points_below(1.0);
  const PointCloud near = beside_points(found, most, photos);
  CHECK(count_above(1.4, found) > 10);
  CHECK(count_above(1.4, near) == 0);
  CHECK(near.size() > found.size() * 3 / 4);

  // What a start has that is no sparse point.
  const auto added = [&](const PointCloud& sparse, const std::string& init) {
    Dataset dataset;
    dataset.points = sparse;
    TrainOptions options;
    options.init = init;
    const Gaussians model = initial_model(
        dataset, cameras, [&photos](PhotoChoice) -> const auto& { return photos; }, 2000, options);
    PointCloud out;
    for (std::size_t i = 0; i < model.size(); ++i) {
      const float* p = model.means.data() + 3 * i;
      if (p[0] != 4.0f) append_point(out, {p[0], p[1], p[2]}, {});
    }
    return out;
  };
  CHECK(added(most, "colmap").size() == 0);
  CHECK(added(most, "auto").size() > 200);
  // But for those where there are no sparse ones (point_cover_test.cpp), of a fifth of 400 pixels.
  const double typical = typical_depth(cameras, most);
  const std::size_t uncovered =
      count_above(1.4, uncovered_points(most, photos, typical, 80, TrainOptions{}.seed));
  CHECK(uncovered > 0);
  CHECK(count_above(1.4, added(most, "auto")) - uncovered < 15);
  // Much of what the photos tell of has no sparse points at all: they are of another part.
  const PointCloud half = points_below(0.4);
  CHECK(bare_share(half, photos) < 0.3);
  CHECK(count_above(1.4, added(half, "auto")) > 30);
  // Where neighbours show something else nothing agrees.
  for (std::size_t i = 0; i < photos.size(); ++i)
    photos[i] = photo_of(cameras[i], [i](const CameraRay& ray) {
      const double shift = 1.7 * static_cast<double>(i);
      return wall({ray.origin + glm::dvec3(0, shift, -shift), ray.direction, true});
    });
  CHECK(probe_sweep(photos, {0.6, 3.0, 30.0}, 5).agreed < 0.4);
  CHECK(probe_sweep(photos_of_wall(), {0.6, 3.0, 30.0}, 5).agreed > 0.6);
  CHECK(probe_sweep({}, {0.6, 3.0, 30.0}, 5).agreed == 0.0);
}

TEST_CASE("the less photos tell of depth, the fewer of their points stand beside sparse ones") {
  std::size_t before = 0;
  for (const double top : {-0.85, 0.0}) {
    // The wall is white above.
    const auto partly_white = [top](const CameraRay& ray) {
      const double t = (4.0 - ray.origin.x) / ray.direction.x;
      return ray.origin.z + t * ray.direction.z > top ? glm::dvec4(0.9, 0.9, 0.9, 1.0) : wall(ray);
    };
    std::vector<SmallPhoto> photos;
    for (const SmallPhoto& photo : photos_of_wall())
      photos.push_back(photo_of(photo.camera, partly_white));
    Dataset dataset;
    dataset.points = points_below(top);
    const Gaussians model = initial_model(
        dataset, cameras_of(photos), [&photos](PhotoChoice) -> const auto& { return photos; }, 2000,
        {});
    std::size_t added = 0;
    for (std::size_t i = 0; i < model.size(); ++i) added += model.means[3 * i] != 4.0f ? 1 : 0;
    MESSAGE(probe_sweep(photos, {0.6, 3.0, 30.0}, 5).agreed << " agrees: " << added << " of "
                                                            << model.size());
    CHECK(added > 5 * before / 4);
    before = added;
  }
}

TEST_CASE("of a cloud that is mostly out of sight the start takes what the photos see") {
  const std::vector<SmallPhoto> photos = photos_of_wall();
  const std::vector<Camera> cameras = cameras_of(photos);
  const PointCloud sound = points_of_wall([](const glm::dvec3& p) { return p; });
  const std::size_t seen = seen_points(sound, cameras).size();
  CHECK(seen > sound.size() / 2);
  Dataset dataset;
  dataset.points = sound;
  for (int k = 0; k < 9; ++k) {
    // Behind the cameras.
    for (std::size_t i = 0; i < sound.positions.size(); i += 3) {
      dataset.points.positions.push_back(-50.0f - static_cast<float>(k));
      dataset.points.positions.push_back(sound.positions[i + 1]);
      dataset.points.positions.push_back(sound.positions[i + 2]);
      dataset.points.colors.insert(dataset.points.colors.end(), {0.1f, 0.6f, 0.3f});
    }
  }
  CHECK(seen_share(dataset.points.positions, cameras) < 0.2);
  const Gaussians model = initial_model(
      dataset, cameras, [&photos](PhotoChoice) -> const auto& { return photos; }, 4000, {});
  for (std::size_t i = 0; i < model.size(); ++i) REQUIRE(model.means[3 * i] > 0.0f);
  CHECK(model.size() > 1500);
}

TEST_CASE("a start leaves points out that the photos contradict, unless it is told not to") {
  const std::vector<SmallPhoto> photos = photos_of_wall();
  const std::vector<Camera> cameras = cameras_of(photos);
  Dataset dataset;
  TrainOptions options;
  const auto middle_depth = [&](const PointCloud& points) {
    dataset.points = points;
    const Gaussians model = initial_model(
        dataset, cameras, [&photos](PhotoChoice) -> const auto& { return photos; }, 1000, options);
    std::vector<double> depths;
    for (std::size_t i = 0; i < model.size(); ++i)
      depths.push_back(static_cast<double>(model.means[3 * i]));
    return quantiles(depths, std::array<double, 1>{0.5})[0];
  };
  const PointCloud sound = points_of_wall([](const glm::dvec3& p) { return p; });
  const PointCloud far = points_of_wall([](const glm::dvec3& p) { return 10.0 * p; });
  CHECK(middle_depth(sound) == doctest::Approx(4.0).epsilon(0.01));
  CHECK(middle_depth(far) < 15.0);
  options.init = "colmap";
  CHECK(middle_depth(far) == doctest::Approx(40.0));
}
