// SPDX-License-Identifier: Apache-2.0
#include "train/start/point_cover.hpp"

#include <doctest/doctest.h>

#include <glm/geometric.hpp>
#include <string>
#include <vector>

#include "train/start/initialization.hpp"
#include "train/start/point_cloud.hpp"
#include "unit/train/test_photos.hpp"

using namespace raysplats;
using namespace raysplats::test;

namespace {

constexpr double kSkyAbove = 0.3;  // at the wall's distance

// The wall, and a sky of one colour above it.
glm::dvec4 wall_and_sky(const CameraRay& ray) {
  const double t = (4.0 - ray.origin.x) / ray.direction.x;
  const bool sky = ray.origin.z + t * ray.direction.z > kSkyAbove;
  return sky ? glm::dvec4(0.5, 0.7, 0.95, 1.0) : wall(ray);
}

std::vector<SmallPhoto> photos_of_wall_and_sky() {
  std::vector<SmallPhoto> out = photos_of_wall();
  for (SmallPhoto& photo : out) photo = photo_of(photo.camera, wall_and_sky);
  return out;
}

std::size_t count_blue(const PointCloud& points) {
  std::size_t out = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const glm::dvec3 color = triple(points.colors, i);
    out += glm::distance(color, {0.5, 0.7, 0.95}) < 0.02 ? 1 : 0;
  }
  return out;
}

}  // namespace

TEST_CASE("points stand on what has no sparse points, at depths up to a thousand times the usual") {
  std::vector<SmallPhoto> photos = photos_of_wall_and_sky();
  const PointCloud sparse = points_below(kSkyAbove);
  const PointCloud points = uncovered_points(sparse, photos, 4.0, 1000, 7);
  CHECK(points.positions == uncovered_points(sparse, photos, 4.0, 1000, 7).positions);
  MESSAGE(points.size() << " of 1000 pixels");
  REQUIRE(points.size() > 150);
  CHECK(points.size() < 450);
  // But for cells that show the wall's edge.
  CHECK(count_blue(points) > points.size() * 8 / 10);
  std::size_t near = 0, far = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const double distance = glm::length(triple(points.positions, i));
    CHECK(distance > 3.0);
    CHECK(distance < 4001.0);
    near += distance < 40.0 ? 1 : 0;
    far += distance > 400.0 ? 1 : 0;
  }
  CHECK(near > points.size() / 4);
  CHECK(far > points.size() / 4);
  // Without sparse points all places lack them; what the photos do not show gets none.
  CHECK(uncovered_points({}, photos, 4.0, 1000, 7).size() == 1000);
  for (SmallPhoto& photo : photos)
    photo = photo_of(photo.camera, [](const CameraRay&) { return glm::dvec4(0.0); });
  CHECK(uncovered_points(sparse, photos, 4.0, 1000, 7).size() == 0);
}

TEST_CASE("a start from sparse points has some where there are none, unless these are asked for") {
  const std::vector<SmallPhoto> photos = photos_of_wall_and_sky();
  std::vector<Camera> cameras;
  cameras.reserve(photos.size());
  for (const SmallPhoto& photo : photos) cameras.push_back(photo.camera);
  Dataset dataset;
  dataset.points = points_below(kSkyAbove);
  // What a start has behind the wall.
  const auto behind = [&](const TrainOptions& options) {
    const Gaussians model = initial_model(
        dataset, cameras, [&photos](PhotoChoice) -> const auto& { return photos; }, 4000, options);
    std::size_t out = 0;
    for (std::size_t i = 0; i < model.size(); ++i) out += model.means[3 * i] > 40.0f ? 1 : 0;
    return out;
  };
  TrainOptions options;
  CHECK(behind(options) > 10);
  CHECK(behind(options) < 200);
  options.photo_points = false;
  CHECK(behind(options) > 10);
  options.uncovered_points = false;
  CHECK(behind(options) == 0);
  options = {};
  // A body of which alpha shows all has nothing around it, nor has what bounds leave.
  dataset.alpha_is_background = true;
  CHECK(behind(options) == 0);
  dataset.alpha_is_background = false;
  options.bounds = Bounds{{0.0, -9.0, -9.0}, {5000.0, 9.0, 5000.0}};
  CHECK(behind(options) < 3);  // of the sweep's points beside sparse ones
  options = {};
  options.init = "colmap";
  CHECK(behind(options) == 0);
}
