// SPDX-License-Identifier: Apache-2.0
#include "train/start/initialization.hpp"

#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <glm/geometric.hpp>
#include <limits>
#include <vector>

#include "raysplats/error.hpp"
#include "scene/kd_tree.hpp"
#include "unit/log_capture.hpp"
#include "unit/train/test_photos.hpp"
#include "util/rng.hpp"

using namespace raysplats;
using namespace raysplats::test;

TEST_CASE("points become Gaussians with their colour, clamped scales and the opacity asked for") {
  // Extent 20 * 1.1 about the middle of two cameras.
  const std::vector<Camera> cameras{look_at({20, 0, 0}, {0, 0, 0}, {0, 0, 1}, 80, 80, 80),
                                    look_at({-20, 0, 0}, {0, 0, 0}, {0, 0, 1}, 80, 80, 80)};
  PointCloud points;
  points.positions = {
      0, 0, 0, 1, 0, 0, 0, 2, 0, 50, 50, 50, std::numeric_limits<float>::quiet_NaN(), 0, 0};
  points.colors = {1, 0.5f, 0, 0, 0, 0, 1, 1, 1, 0.2f, 0.4f, 0.6f, 0, 0, 0};
  const Gaussians model = gaussians_from_points(points, 2, 0.1, cameras);
  REQUIRE(model.size() == 4);
  CHECK(model.sh.size() == 4 * 27);
  for (std::size_t i = 0; i < 4; ++i) {
    CHECK(1.0 / (1.0 + std::exp(-model.opacities[i])) == doctest::Approx(0.1));
    for (std::size_t c = 0; c < 3; ++c) {
      CHECK(0.5 + 0.28209479177387814 * model.sh[27 * i + c] ==
            doctest::Approx(points.colors[3 * i + c]));
    }
    CHECK(model.sh[27 * i + 3] == 0.0f);
  }
  // Far from everything: a tenth of the distance to the nearest camera at most.
  CHECK(std::exp(model.log_scales[9]) == doctest::Approx(0.1 * std::sqrt(30.0 * 30 + 2 * 50 * 50)));
  PointCloud pair;
  pair.positions = {0, 0, 0, 1e-4f, 0, 0};
  pair.colors.assign(6, 0.5f);
  const auto first_size = [&cameras](const PointCloud& of) {
    return std::exp(gaussians_from_points(of, 0, 0.1, cameras).log_scales[0]);
  };
  CHECK(first_size(pair) == doctest::Approx(22.0 * 1e-4));
  // Without a distance to a neighbour: the most.
  pair.positions[3] = 0;
  CHECK(first_size(pair) == doctest::Approx(2.0));
  PointCloud one;
  one.positions.assign(3, 0.0f);
  one.colors.assign(3, 0.5f);
  CHECK(first_size(one) == doctest::Approx(2.0));
}

TEST_CASE("Gaussians of points have the bytes of a loop over all points and cameras") {
  std::vector<Camera> cameras = ring(60, 4.0, {0.3, -0.2, 0.1});
  CounterRng rng(5, 1);
  PointCloud points;
  for (int i = 0; i < 3 * 3000; ++i) {
    // Many far from each other, whose sizes the cameras bound.
    points.positions.push_back(static_cast<float>(4.0 * rng.normal()));
    points.colors.push_back(static_cast<float>(rng.uniform()));
  }
  const Gaussians model = gaussians_from_points(points, 1, 0.1, cameras);
  REQUIRE(model.size() == points.size());
  CHECK(model.means == points.positions);
  const double least = 1e-4 * scene_extent(cameras, points);
  const std::vector<float> sizes = neighbour_distances(points.positions);
  std::size_t bounded = 0;
  std::vector<float> expected;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const float* p = points.positions.data() + 3 * i;
    double nearest = std::numeric_limits<double>::infinity();
    for (const Camera& camera : cameras)
      nearest = std::min(nearest, glm::distance(camera.center(), glm::dvec3(p[0], p[1], p[2])));
    const auto size = static_cast<double>(sizes[i]);
    if (size > 0.1 * nearest) ++bounded;
    const double scale = std::max(std::min(size, 0.1 * nearest), least);
    expected.insert(expected.end(), 3, static_cast<float>(std::log(scale)));
  }
  CHECK(model.log_scales == expected);
  CHECK(bounded > 100);
  CHECK(bounded < 2900);
}

TEST_CASE("points that few photos show or that fit them badly are left out when enough remain") {
  PointCloud points;
  const auto add = [&points](std::uint32_t track, float error) {
    points.positions.insert(points.positions.end(), 3, static_cast<float>(points.size()));
    points.colors.insert(points.colors.end(), 3, 0.5f);
    points.track_lengths.push_back(track);
    points.errors.push_back(error);
  };
  for (int i = 0; i < 2500; ++i) add(3, 1.0f);
  add(2, 0.1f);
  add(9, 2.5f);
  CHECK(reliable_points(points).size() == 2500);
  PointCloud few = points;
  few.track_lengths.assign(few.size(), 2);
  CHECK(reliable_points(few).size() == few.size());
  few.track_lengths.clear();
  CHECK(reliable_points(few).size() == few.size());
}

TEST_CASE("sizes are those of the points that a start takes, each place once") {
  Dataset dataset;
  // A square grid of unit steps, every point four times.
  for (int i = 0; i < 4 * 400; ++i) {
    const int column = i / 4 % 20, row = i / 80;
    dataset.points.positions.insert(dataset.points.positions.end(),
                                    {static_cast<float>(column), static_cast<float>(row), 0.0f});
    dataset.points.colors.insert(dataset.points.colors.end(), 3, 0.5f);
  }
  TrainOptions options;
  options.init = "colmap";
  const std::vector<Camera> cameras = ring(6, 100.0, {10, 10, 0});
  const std::vector<SmallPhoto> none;
  const auto sizes = [&](std::size_t limit) {
    const Gaussians model = initial_model(
        dataset, cameras, [&none](PhotoChoice) -> const auto& { return none; }, limit, options);
    std::vector<double> out;
    for (std::size_t i = 0; i < model.size(); ++i) out.push_back(std::exp(model.log_scales[3 * i]));
    std::sort(out.begin(), out.end());
    return out;
  };
  const std::vector<double> all = sizes(1000);
  REQUIRE(all.size() == 400);
  CHECK(all[200] == doctest::Approx(1.0));
  // Every other point of a row is left: neighbours are one, one and two steps away.
  const std::vector<double> some = sizes(200);
  REQUIRE(some.size() == 100);
  CHECK(some[50] == doctest::Approx(4.0 / 3.0));
}

TEST_CASE("the limit grows with the roots of pixels and iterations") {
  CHECK(fitted_limit(100000, 1000) == 45000);
  CHECK(fitted_limit(100000, 4000) == 90000);
  CHECK(fitted_limit(400000, 1000) == 90000);
  CHECK(fitted_limit(10, 1000) == 2000);
}

TEST_CASE("the first model follows the options") {
  Dataset dataset;
  dataset.root = "somewhere";
  TrainOptions options;
  options.init_count = 50;
  options.sh_degree = 1;
  const std::vector<Camera> cameras = ring(6, 2.0, {0, 0, 0});
  const std::vector<SmallPhoto> none;
  const auto first = [&](std::size_t limit) {
    return initial_model(
        dataset, cameras, [&none](PhotoChoice) -> const auto& { return none; }, limit, options);
  };
  options.init = "random";
  CHECK(first(1000).size() == 50);
  options.init_count = 0;
  CHECK(first(1000).size() == 500);
  CHECK(first(1000).opacities.front() == doctest::Approx(std::log(0.02 / 0.98)));
  options.init = "colmap";
  CHECK_THROWS_AS(first(1000), UsageError);
  for (int i = 0; i < 90; ++i) {
    dataset.points.positions.push_back(static_cast<float>(i) * 0.01f);
    dataset.points.colors.push_back(0.5f);
  }
  CHECK(first(1000).size() == 30);
  options.init = "auto";
  CHECK(first(100).size() == 30);
  // Half of the limit: the start leaves room to grow.
  const Gaussians few = first(14);
  CHECK(few.size() == 7);
  CHECK(few.opacities.front() == doctest::Approx(std::log(0.1 / 0.9)));
  CHECK(few.sh.size() == 7 * 12);
  options.init = "random";
  options.init_count = 50;
  {
    const LogCapture log;
    CHECK(first(50).size() == 50);
    CHECK(log.lines() == 0);
    CHECK(first(7).size() == 7);
    CHECK(log.contains("--init-count asks for 50 Gaussians, but this run may have 7"));
  }
  options.init = "/nowhere/model.ply";
  CHECK_THROWS_AS(first(1000), DataError);
}
