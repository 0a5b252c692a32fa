// SPDX-License-Identifier: Apache-2.0
#include "train/start/photo_start.hpp"

#include <algorithm>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec4.hpp>
#include <vector>

#include "train/start/photo_pixel.hpp"
#include "train/start/point_cloud.hpp"
#include "util/parallel.hpp"
#include "util/rng.hpp"

namespace raysplats {
namespace {

// Random streams of one seed are told apart by a constant.
constexpr std::uint64_t kCarveStream = 0x6361727665;
constexpr std::uint64_t kScatterStream = 0x73636174746572;
constexpr std::size_t kTriesPerPoint = 200;

constexpr std::size_t kLeastLooks = 4;     // photos, for masks to tell of a place
constexpr double kLeastCounted = 0.5;      // of them, for its points to be trained
constexpr std::size_t kColourPhotos = 24;  // that tell the colour of a scattered point

// Whether the photo shows something at the point or next to it.
bool shows_something(const SmallPhoto& photo, const glm::dvec2& point) {
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      if (photo.at(point + glm::dvec2(dx, dy)).w > kLeastAlpha) return true;
    }
  }
  return false;
}

glm::dvec3 median_color(std::vector<glm::dvec3>& colors) {
  glm::dvec3 out(0.5);
  if (colors.empty()) return out;
  const auto middle = colors.begin() + static_cast<std::ptrdiff_t>(colors.size() / 2);
  for (int c = 0; c < 3; ++c) {
    std::nth_element(colors.begin(), middle, colors.end(),
                     [c](const glm::dvec3& a, const glm::dvec3& b) { return a[c] < b[c]; });
    out[c] = (*middle)[c];
  }
  return out;
}

// The points whose places are kept.
template <class Keeps>
PointCloud kept_points(const PointCloud& points, const Keeps& keeps) {
  std::vector<std::uint8_t> kept(points.size());
  in_parallel(points.size(), [&](std::size_t i) {
    const float* p = points.positions.data() + 3 * i;
    kept[i] = keeps(glm::dvec3(p[0], p[1], p[2]));
  });
  PointCloud out;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (kept[i]) append_point(points, i, out);
  }
  return out;
}

}  // namespace

PointCloud carved_points(std::span<const SmallPhoto> photos,
                         const Region& region,
                         std::size_t count,
                         std::uint64_t seed) {
  CounterRng rng(seed, kCarveStream);
  PointCloud out;
  std::vector<glm::dvec3> colors, faint;
  for (std::size_t tried = 0; out.size() < count && tried < kTriesPerPoint * count; ++tried) {
    glm::dvec3 world;
    for (int a = 0; a < 3; ++a)
      world[a] = region.center[a] + region.half_side * (2.0 * rng.uniform() - 1.0);
    colors.clear();
    faint.clear();
    bool inside = true;
    for (const SmallPhoto& photo : photos) {
      const auto point = photo.sees(world);
      // What a mask ignores says neither that something is there nor that nothing is.
      if (!point || !photo.known(*point)) continue;
      inside = shows_something(photo, *point);
      if (!inside) break;
      const glm::dvec4 color = photo.at(*point);
      if (color.w > 0.5) colors.emplace_back(color);
      if (color.w > kLeastAlpha) faint.emplace_back(color);
    }
    if (colors.empty()) colors = faint;  // of what is half transparent
    if (inside && !colors.empty()) append_point(out, world, median_color(colors));
  }
  return out;
}

PointCloud hull_points(const PointCloud& points, std::span<const SmallPhoto> photos) {
  return kept_points(points, [&](const glm::dvec3& world) {
    std::size_t looked = 0, shown = 0;
    for (const SmallPhoto& photo : photos) {
      const auto point = photo.sees(world);
      if (!point || !photo.known(*point)) continue;
      ++looked;
      shown += shows_something(photo, *point) ? 1 : 0;
    }
    return 2 * shown > looked;
  });
}

PointCloud counted_points(const PointCloud& points, std::span<const SmallPhoto> photos) {
  return kept_points(points, [&](const glm::dvec3& world) {
    std::size_t looked = 0, counted = 0;
    for (const SmallPhoto& photo : photos) {
      const auto point = photo.sees(world);
      if (!point) continue;
      ++looked;
      counted += photo.known(*point) && photo.at(*point).w >= 0.5 ? 1 : 0;
    }
    return looked < kLeastLooks ||
           static_cast<double>(counted) >= kLeastCounted * static_cast<double>(looked);
  });
}

PointCloud scattered_points(std::span<const SmallPhoto> photos,
                            const Region& region,
                            const DepthRange& depths,
                            std::size_t count,
                            std::uint64_t seed) {
  struct Sample {
    glm::dvec3 position, color;
  };
  std::vector<Sample> samples(count);
  const std::size_t stride = std::max<std::size_t>(1, photos.size() / kColourPhotos);
  in_parallel(count, [&](std::size_t i) {
    CounterRng rng(seed, kScatterStream, 8 * i);
    glm::dvec3 world;
    for (int a = 0; a < 3; ++a)
      world[a] = region.center[a] + region.half_side * (2.0 * rng.uniform() - 1.0);
    if (!photos.empty() && i % 2 == 1) {
      const PhotoPixel pixel = random_pixel(photos, rng);
      if (pixel.shows()) world = pixel.ray.origin + depths.at(rng.uniform()) * pixel.ray.direction;
    }
    std::vector<glm::dvec3> colors;
    for (std::size_t k = i % stride; k < photos.size(); k += stride) {
      const auto point = photos[k].sees(world);
      if (!point) continue;
      const glm::dvec4 color = photos[k].at(*point);
      if (color.w > 0.5) colors.emplace_back(color);
    }
    samples[i] = {world, median_color(colors)};
  });
  PointCloud out;
  for (const Sample& sample : samples) append_point(out, sample.position, sample.color);
  return out;
}

}  // namespace raysplats
