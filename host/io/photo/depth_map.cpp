// SPDX-License-Identifier: Apache-2.0
#include "io/photo/depth_map.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <optional>
#include <utility>
#include <variant>

#include "io/image/image_file.hpp"
#include "io/npy_file.hpp"
#include "raysplats/error.hpp"
#include "scene/camera/camera_model.hpp"
#include "scene/image/pixel_count.hpp"
#include "util/path_text.hpp"

namespace raysplats::io {
namespace {

// Sparse points that fewer photos show, or that lie further beside their places there, are no
// measure of depth.
constexpr std::uint32_t kLeastTrack = 3;
constexpr float kMostError = 2.0f;

DepthMap read_array(const std::filesystem::path& path) {
  NpyArray array = read_npy(path);
  // One channel, as OpenCV or as PyTorch counts it.
  if (array.shape.size() == 3 && array.shape.back() == 1) {
    array.shape.pop_back();
  } else if (array.shape.size() == 3 && array.shape.front() == 1) {
    array.shape.erase(array.shape.begin());
  }
  if (array.shape.size() != 2 || array.data.empty()) {
    throw DataError(
        fmt::format("The depth map {} has {} dimensions: give an array of height x width",
                    path.string(), array.shape.size()));
  }
  return {static_cast<int>(array.shape[1]), static_cast<int>(array.shape[0]),
          std::move(array.data)};
}

DepthMap read_picture(const std::filesystem::path& path) {
  const RawImage raw = read_stored_numbers(path);
  if (raw.channels != 1 || std::holds_alternative<std::vector<std::uint8_t>>(raw.numbers)) {
    throw DataError(
        fmt::format("The depth map {} has {} channels of {} bits: give one channel of 16 or "
                    "32 bits, or floats",
                    path.string(), raw.channels,
                    raw.numbers.index() == 0   ? 8
                    : raw.numbers.index() == 1 ? 16
                                               : 32));
  }
  DepthMap out{raw.width, raw.height, {}};
  std::visit([&out](const auto& numbers) { out.values.assign(numbers.begin(), numbers.end()); },
             raw.numbers);
  return out;
}

// Refuses a map of another shape than its photo.
void check_shape(const DepthMap& map, const View& view) {
  const Camera& photo = view.source_camera;
  const double expected_height = static_cast<double>(map.width) * photo.height / photo.width;
  if (std::abs(expected_height - map.height) > std::max(2.0, 0.02 * map.height)) {
    throw DataError(fmt::format(
        "The depth map {} has {} x {} pixels but its photo {} x {}, which is another shape: make "
        "it of the photo that it belongs to",
        view.depth_path.string(), map.width, map.height, photo.width, photo.height));
  }
}

DepthMap from_map(const DepthMap& map, const View& view) {
  check_shape(map, view);
  Camera photo = view.source_camera;  // in the place of the view, whatever its own
  photo.rotation = view.camera.rotation;
  photo.translation = view.camera.translation;
  const Camera& camera = view.camera;
  const bool same_rays = camera.model == photo.model;
  const bool other_depths = counts_along_ray(camera) && !counts_along_ray(photo);
  DepthMap out{camera.width, camera.height, {}};
  out.values.resize(pixel_count(camera.width, camera.height));
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      // As shares of the photo.
      double across = (x + 0.5) / camera.width, down = (y + 0.5) / camera.height;
      double share = 1.0;
      if (!same_rays) {
        const CameraRay ray = camera_ray(camera, x + 0.5, y + 0.5);
        if (!ray.valid) continue;
        const auto point = project(photo, ray.origin + ray.direction);
        if (!point) continue;
        across = point->x / photo.width;
        down = point->y / photo.height;
        if (other_depths) share = 1.0 / (camera.rotation * ray.direction).z;
      }
      // What a lens shows far beyond the photo fits no integer.
      const double column = std::floor(across * map.width), row = std::floor(down * map.height);
      const bool inside = column >= 0 && row >= 0 && column < map.width && row < map.height;
      if (!inside) continue;
      const float depth = map.values[pixel_count(map.width, static_cast<int>(row)) +
                                     static_cast<std::size_t>(column)];
      out.values[pixel_count(camera.width, y) + static_cast<std::size_t>(x)] =
          static_cast<float>(share * static_cast<double>(depth));
    }
  }
  return out;
}

DepthMap from_points(const PointCloud& points, const View& view) {
  const Camera& camera = view.camera;
  DepthMap out{camera.width, camera.height, {}};
  out.values.resize(pixel_count(camera.width, camera.height));
  for (const std::uint32_t number : view.points) {
    if (points.track_lengths[number] < kLeastTrack || points.errors[number] > kMostError) continue;
    const float* p = points.positions.data() + 3 * std::size_t{number};
    const glm::dvec3 world(p[0], p[1], p[2]);
    const std::optional<glm::dvec2> at = project(camera, world);
    if (!at || !(at->x >= 0 && at->x < camera.width && at->y >= 0 && at->y < camera.height))
      continue;
    float& value = out.values[pixel_count(camera.width, static_cast<int>(at->y)) +
                              static_cast<std::size_t>(at->x)];
    const auto depth = static_cast<float>(depth_of(camera, world));
    if (depth > 0 && (value == 0 || depth < value)) value = depth;
  }
  return out;
}

}  // namespace

DepthMap read_depth_map(const std::filesystem::path& path, double unit, bool again) {
  DepthMap out = lower_extension(path) == ".npy" ? read_array(path) : read_picture(path);
  std::size_t odd = 0;
  for (float& value : out.values) {
    odd += std::isfinite(value) ? 0 : 1;
    value = std::isfinite(value) && value > 0 ? static_cast<float>(unit * value) : 0.0f;
  }
  if (odd > 0 && !again) {
    spdlog::warn("{} of {} numbers of the depth map {} are not finite: they count as unknown", odd,
                 out.values.size(), path.string());
  }
  return out;
}

DepthMap view_depths(const Dataset& dataset, const View& view, double unit, bool again) {
  if (!view.depth_path.empty()) return from_map(read_depth_map(view.depth_path, unit, again), view);
  if (!view.points.empty()) return from_points(dataset.points, view);
  return {};
}

std::size_t count_known(const DepthMap& depths) {
  return static_cast<std::size_t>(
      std::count_if(depths.values.begin(), depths.values.end(), [](float d) { return d > 0; }));
}

bool check_depth_map(const View& view, double unit) {
  const DepthMap map = read_depth_map(view.depth_path, unit);
  check_shape(map, view);
  return count_known(map) > 0;
}

DepthMap reduced(const DepthMap& depths, int width, int height) {
  if (depths.values.empty() || (width == depths.width && height == depths.height)) return depths;
  DepthMap out{width, height, {}};
  out.values.resize(pixel_count(width, height));
  std::vector<float> known;
  for (int y = 0; y < height; ++y) {
    const int top = static_cast<int>(static_cast<std::int64_t>(y) * depths.height / height);
    const int bottom = std::max(
        top + 1, static_cast<int>((static_cast<std::int64_t>(y) + 1) * depths.height / height));
    for (int x = 0; x < width; ++x) {
      const int left = static_cast<int>(static_cast<std::int64_t>(x) * depths.width / width);
      const int right = std::max(
          left + 1, static_cast<int>((static_cast<std::int64_t>(x) + 1) * depths.width / width));
      known.clear();
      for (int row = top; row < bottom; ++row) {
        for (int column = left; column < right; ++column) {
          const float value =
              depths.values[pixel_count(depths.width, row) + static_cast<std::size_t>(column)];
          if (value > 0) known.push_back(value);
        }
      }
      if (known.empty()) continue;
      const auto middle = known.begin() + static_cast<std::ptrdiff_t>(known.size() / 2);
      std::nth_element(known.begin(), middle, known.end());
      out.values[pixel_count(width, y) + static_cast<std::size_t>(x)] = *middle;
    }
  }
  return out;
}

}  // namespace raysplats::io
