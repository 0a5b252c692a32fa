// SPDX-License-Identifier: Apache-2.0
// Six photos of a room, with and without what is known of their depths.
#include <doctest/doctest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <numbers>
#include <string>
#include <vector>

#include "io/photo/depth_map.hpp"
#include "light/view_tracer.hpp"
#include "raysplats/context.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/device.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "raysplats/trainer.hpp"
#include "scene/camera/camera_model.hpp"
#include "unit/fixture.hpp"
#include "unit/log_capture.hpp"
#include "unit/train/depth_file.hpp"
#include "unit/train/short_training.hpp"
#include "util/rng.hpp"

using namespace raysplats;
namespace fs = std::filesystem;

namespace {

constexpr int kSize = 48;
constexpr double kSide = 3;    // of the room from its middle to a wall
constexpr double kRadius = 1;  // of the ball in its middle

// How far along the ray something is.
double distance_along(const CameraRay& ray) {
  double nearest = std::numeric_limits<double>::infinity();
  for (int a = 0; a < 3; ++a) {
    const double wall = (std::copysign(kSide, ray.direction[a]) - ray.origin[a]) / ray.direction[a];
    nearest = std::min(nearest, wall);
  }
  const double along = -glm::dot(ray.origin, ray.direction);
  const glm::dvec3 off = ray.origin + along * ray.direction;
  const double inside = kRadius * kRadius - glm::dot(off, off);
  return inside > 0 && along > 0 ? std::min(nearest, along - std::sqrt(inside)) : nearest;
}

glm::dvec3 color_of(const glm::dvec3& p) {
  return {0.5 + 0.3 * std::sin(2.1 * p.x + 1.7 * p.y) * std::cos(1.9 * p.z),
          0.5 + 0.3 * std::cos(2.6 * p.y - 1.1 * p.z), 0.5 + 0.3 * std::sin(3.1 * p.z + 0.9 * p.x)};
}

CameraRay ray_at(const Camera& camera, int x, int y) {
  return camera_ray(camera, x + 0.5, y + 0.5);
}

double depth_at(const Camera& camera, int x, int y) {
  const CameraRay ray = ray_at(camera, x, y);
  const glm::dvec3 axis = camera_ray(camera, camera.cx, camera.cy).direction;
  return distance_along(ray) * glm::dot(ray.direction, axis);
}

void write_depths(const fs::path& path, const Camera& camera, float unit) {
  std::vector<float> numbers;
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x)
      numbers.push_back(static_cast<float>(depth_at(camera, x, y)) / unit);
  }
  write_depth_file(path, camera.width, camera.height, numbers);
}

// Six photos all around the ball and four held-out ones between them.
Dataset capture(const fs::path& folder) {
  fs::create_directories(folder);
  Dataset out;
  out.kind = DatasetKind::kNerfstudio;
  out.root = folder;
  for (int i = 0; i < 10; ++i) {
    const bool test = i >= 6;
    const double angle = 2 * std::numbers::pi * (test ? (i - 6) / 4.0 + 0.11 : i / 6.0);
    View view;
    view.camera = look_at({2.4 * std::cos(angle), 2.4 * std::sin(angle), i % 2 == 0 ? 0.8 : -0.5},
                          {0, 0, 0}, {0, 0, 1}, kSize, kSize, 0.7 * kSize);
    view.camera.name = "photo_" + std::to_string(i);
    view.source_camera = view.camera;
    view.test = test;
    Image photo(kSize, kSize, 3);
    for (int y = 0; y < kSize; ++y) {
      for (int x = 0; x < kSize; ++x) {
        const CameraRay ray = ray_at(view.camera, x, y);
        const glm::dvec3 color = color_of(ray.origin + distance_along(ray) * ray.direction);
        for (int c = 0; c < 3; ++c)
          photo.data[static_cast<std::size_t>(3 * (y * kSize + x) + c)] =
              static_cast<float>(color[c]);
      }
    }
    view.image_path = folder / (view.camera.name + ".png");
    write_image(view.image_path, photo);
    out.views.push_back(view);
  }
  return out;
}

// Points that at least three of the photos show, as COLMAP's.
void add_points(Dataset& data, std::size_t count) {
  CounterRng rng(5, 1);
  while (data.points.size() < count) {
    const View& from = data.views[rng.below(6)];
    const CameraRay ray = camera_ray(from.camera, kSize * rng.uniform(), kSize * rng.uniform());
    const glm::dvec3 world = ray.origin + distance_along(ray) * ray.direction;
    std::vector<View*> shown;
    for (View& view : data.views) {
      const glm::dvec3 to = world - view.camera.center();
      const auto at = project(view.camera, world);
      if (!at || !(at->x >= 0 && at->x < kSize && at->y >= 0 && at->y < kSize)) continue;
      const CameraRay look{view.camera.center(), glm::normalize(to), true};
      if (distance_along(look) > glm::length(to) - 1e-6) shown.push_back(&view);
    }
    if (shown.size() < 3) continue;
    for (View* view : shown) view->points.push_back(static_cast<std::uint32_t>(data.points.size()));
    for (int a = 0; a < 3; ++a) {
      data.points.positions.push_back(static_cast<float>(world[a]));
      data.points.colors.push_back(static_cast<float>(color_of(world)[a]));
    }
    data.points.track_lengths.push_back(static_cast<std::uint32_t>(shown.size()));
    data.points.errors.push_back(0.5f);
  }
}

// The median relative error of depth in the held-out views.
double depth_error(Context& context,
                   const Dataset& data,
                   TrainOptions options,
                   const fs::path& run) {
  options.init = "photos";  // what is known of depth shall come from the loss
  Trainer trainer(context, data, options, run);
  trainer.run(false);
  TraceOptions trace = peak_order();
  trace.depth = true;
  ViewTracer tracer(context, trace);
  std::vector<double> errors;
  for (const std::size_t index : data.indices(Split::kTest)) {
    const Camera& camera = data.views[index].camera;
    tracer.forward(trainer.gaussians(), camera);
    const Image depth = tracer.download_depth();
    for (int y = 0; y < kSize; ++y) {
      for (int x = 0; x < kSize; ++x) {
        const double got =
            static_cast<double>(depth.data[static_cast<std::size_t>(3 * (y * kSize + x))]);
        errors.push_back(std::abs(got / depth_at(camera, x, y) - 1));
      }
    }
  }
  std::nth_element(errors.begin(), errors.begin() + static_cast<std::ptrdiff_t>(errors.size() / 2),
                   errors.end());
  return errors[errors.size() / 2];
}

}  // namespace

TEST_CASE("maps and points halve the error of depth of six photos") {
  const TemporaryDirectory folder;
  Context context{test_device()};
  TrainOptions options = short_training(400);
  options.max_gaussians = 2500;
  Dataset plain = capture(folder.path() / "data");
  const double without = depth_error(context, plain, options, folder.path() / "without");

  options.depth_weight = 0.5;
  CHECK_THROWS_AS(Trainer(context, plain, options, folder.path() / "none"), UsageError);
  Dataset with_maps = plain;
  for (View& view : with_maps.views) {
    view.depth_path = folder.path() / (view.camera.name + ".npy");
    write_depths(view.depth_path, view.camera, 1e-3f);
  }
  const double maps = depth_error(context, with_maps, options, folder.path() / "maps");
  Dataset with_points = plain;
  add_points(with_points, 600);
  const double points = depth_error(context, with_points, options, folder.path() / "points");
  MESSAGE("median relative error of depth: " << without << " from photos alone, " << maps
                                             << " with maps, " << points << " with points");
  CHECK(maps < 0.5 * without);
  CHECK(points < 0.5 * without);
}

TEST_CASE("depth maps that are read again for every step train as those that stay") {
  const TemporaryDirectory folder;
  Context context{test_device()};
  Dataset data = capture(folder.path() / "data");
  for (View& view : data.views) {
    if (view.camera.name == "photo_3") continue;
    view.depth_path = folder.path() / (view.camera.name + ".npy");
    write_depths(view.depth_path, view.camera, 1e-3f);
  }
  TrainOptions options = short_training(40);
  options.max_gaussians = 600;
  options.depth_weight = 0.5;
  options.trace.deterministic = true;
  const auto trained = [&](const char* name, bool room) {
    options.image_budget = room ? 1024 : 0;
    const LogCapture log;
    Trainer trainer(context, data, options, folder.path() / name);
    CHECK(log.contains("read again for every step") == !room);
    trainer.run(false);
    return trainer.model();
  };
  check_equal(trained("stay", true), trained("come", false));
}

TEST_CASE(
    "panoramas that a schedule makes too small for gradients of depth are refused at the start") {
  const TemporaryDirectory scratch;
  Context context{test_device()};
  Dataset data = capture(scratch.path() / "data");
  for (View& view : data.views) {
    view.camera.model = CameraModel::kEquirectangular;
    view.camera.width = 320;
    view.camera.height = 160;
    view.source_camera = view.camera;
    write_image(view.image_path, Image(320, 160, 3, 0.5f));
  }
  TrainOptions options;
  options.depth_weight = 0.5;
  const auto refused = [&] {
    try {
      const Trainer trainer(context, data, options, scratch.path() / "run");
    } catch (const UsageError& error) {
      return std::string(error.what());
    }
    return std::string();
  };
  CHECK(refused().find("6 of 6 are not where 'resolution-schedule' makes them 4 times smaller") !=
        std::string::npos);
  options.resolution_schedule.clear();
  CHECK(refused().find("packets") == std::string::npos);
}

TEST_CASE("what is not known of a depth map is left out") {
  const TemporaryDirectory folder;
  const Camera camera = look_at({2, 0, 0}, {0, 0, 0}, {0, 0, 1}, 4, 2, 3);
  const fs::path path = folder.path() / "depth.npy";
  write_depths(path, camera, 0.5f);
  std::fstream stream(path, std::ios::binary | std::ios::in | std::ios::out);
  const float odd[3] = {std::numeric_limits<float>::quiet_NaN(), -1.0f, 0.0f};
  stream.seekp(128);
  stream.write(reinterpret_cast<const char*>(odd), sizeof(odd));
  stream.close();
  const io::DepthMap map = io::read_depth_map(path, 0.5);
  REQUIRE(map.width == 4);
  REQUIRE(map.height == 2);
  for (std::size_t i = 0; i < 8; ++i) {
    const double expected =
        i < 3 ? 0.0 : depth_at(camera, static_cast<int>(i % 4), static_cast<int>(i / 4));
    CHECK(static_cast<double>(map.values[i]) == doctest::Approx(expected).epsilon(1e-5));
  }
  // Of the areas of two pixels by two the left knows one number, the other its median.
  const io::DepthMap small = io::reduced(map, 2, 1);
  std::vector<float> right{map.values[3], map.values[6], map.values[7]};
  std::sort(right.begin(), right.end());
  CHECK(small.values[1] == right[1]);
  CHECK(small.values[0] == std::max(map.values[4], map.values[5]));

  View view;
  view.camera = view.source_camera = camera;
  view.depth_path = path;
  CHECK(io::view_depths({}, view, 0.5).values == map.values);
  view.source_camera.height = 8;
  CHECK_THROWS_AS(io::view_depths({}, view, 0.5), DataError);
  view.depth_path.clear();
  CHECK(io::view_depths({}, view, 0.5).values.empty());
}
