// SPDX-License-Identifier: Apache-2.0
#include "train/photo_start.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <glm/vec2.hpp>
#include <glm/vec4.hpp>
#include <optional>
#include <thread>
#include <vector>

#include "base/rng.hpp"
#include "core/camera_model.hpp"

namespace raysplats {
namespace {

// Random streams of one seed are told apart by a constant.
constexpr std::uint64_t kCarveStream = 0x6361727665;
constexpr std::uint64_t kSweepStream = 0x7377656570;
constexpr std::size_t kTriesPerPoint = 200;

constexpr std::size_t kNeighbours = 5;  // photos that a sweep compares with
constexpr std::size_t kDepths = 48;
constexpr double kAgreement = 0.012;   // largest mean squared difference of what agrees
constexpr double kClear = 0.5;         // and the best depth's share of the median one
constexpr double kUnique = 0.7;        // and of the best one elsewhere: patterns repeat
constexpr std::size_t kElsewhere = 3;  // depth steps from the best one

void append(PointCloud& cloud, const glm::dvec3& position, const glm::dvec3& color) {
  for (int a = 0; a < 3; ++a) {
    cloud.positions.push_back(static_cast<float>(position[a]));
    cloud.colors.push_back(static_cast<float>(color[a]));
  }
}

// Whether the photo shows something at the point or next to it.
bool shows_something(const SmallPhoto& photo, const glm::dvec2& point) {
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      if (photo.at(point + glm::dvec2(dx, dy)).w > 0) return true;
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

// The photos that see most of what a photo sees from somewhere else: near centres, like axes.
std::vector<std::size_t> neighbours_of(std::span<const SmallPhoto> photos,
                                       std::size_t index,
                                       double distance) {
  const auto axis = [&photos](std::size_t i) {
    const Camera& camera = photos[i].camera;
    return camera_ray(camera, 0.5 * camera.width, 0.5 * camera.height).direction;
  };
  std::vector<std::pair<double, std::size_t>> ranked;
  for (std::size_t i = 0; i < photos.size(); ++i) {
    const double base =
        glm::distance(photos[i].camera.center(), photos[index].camera.center()) / distance;
    // Two photos from the same place say nothing about depth.
    if (i == index || base < 1e-3) continue;
    const double turn = 1.0 - glm::dot(axis(i), axis(index));
    ranked.emplace_back(std::abs(base - 0.15) + 2.0 * turn, i);
  }
  const std::size_t count = std::min(kNeighbours, ranked.size());
  std::partial_sort(ranked.begin(), ranked.begin() + static_cast<std::ptrdiff_t>(count),
                    ranked.end());
  std::vector<std::size_t> out(count);
  for (std::size_t i = 0; i < count; ++i) out[i] = ranked[i].second;
  return out;
}

struct Patch {
  std::array<glm::dvec3, 9> colors;
};

Patch patch_at(const SmallPhoto& photo, const glm::dvec2& point) {
  Patch out;
  for (int k = 0; k < 9; ++k) {
    out.colors[static_cast<std::size_t>(k)] =
        glm::dvec3(photo.at(point + glm::dvec2(k % 3 - 1, k / 3 - 1)));
  }
  return out;
}

double difference(const Patch& a, const Patch& b) {
  double sum = 0;
  for (std::size_t k = 0; k < a.colors.size(); ++k) {
    const glm::dvec3 d = a.colors[k] - b.colors[k];
    sum += glm::dot(d, d);
  }
  return sum / static_cast<double>(3 * a.colors.size());
}

double depth_at(double share, const DepthRange& depths) {
  return depths.nearest * std::pow(depths.farthest / depths.nearest, share);
}

double depth_of(std::size_t step, const DepthRange& depths) {
  return depth_at(static_cast<double>(step) / (kDepths - 1), depths);
}

// The depth along the ray at which the neighbours agree with the photo, if there is one.
std::optional<double> agreed_depth(std::span<const SmallPhoto> photos,
                                   std::span<const std::size_t> neighbours,
                                   const CameraRay& ray,
                                   const Patch& reference,
                                   const DepthRange& depths) {
  std::array<double, kDepths> costs{};
  std::vector<double> differences;
  std::vector<double> known;
  for (std::size_t step = 0; step < kDepths; ++step) {
    const glm::dvec3 world = ray.origin + depth_of(step, depths) * ray.direction;
    differences.clear();
    for (const std::size_t i : neighbours) {
      const auto point = photos[i].sees(world);
      if (point && photos[i].at(*point).w >= 0.5)
        differences.push_back(difference(reference, patch_at(photos[i], *point)));
    }
    costs[step] = -1;
    if (2 * differences.size() < neighbours.size() || differences.size() < 2) continue;
    // The better half: what hides the point from some photos does not speak against it.
    const std::size_t half = (differences.size() + 1) / 2 + (differences.size() > 3 ? 1 : 0);
    std::partial_sort(differences.begin(), differences.begin() + static_cast<std::ptrdiff_t>(half),
                      differences.end());
    double sum = 0;
    for (std::size_t k = 0; k < half; ++k) sum += differences[k];
    costs[step] = sum / static_cast<double>(half);
    known.push_back(costs[step]);
  }
  if (known.size() < kDepths / 4) return std::nullopt;
  const auto middle = known.begin() + static_cast<std::ptrdiff_t>(known.size() / 2);
  std::nth_element(known.begin(), middle, known.end());
  std::size_t best = kDepths;
  for (std::size_t step = 0; step < kDepths; ++step) {
    if (costs[step] >= 0 && (best == kDepths || costs[step] < costs[best])) best = step;
  }
  if (costs[best] > kAgreement || costs[best] > kClear * *middle) return std::nullopt;
  for (std::size_t step = 0; step < kDepths; ++step) {
    const bool elsewhere = step + kElsewhere < best || step > best + kElsewhere;
    if (elsewhere && costs[step] >= 0 && costs[best] > kUnique * costs[step]) return std::nullopt;
  }
  return depth_of(best, depths);
}

struct Sample {
  glm::dvec3 position, color;
  bool agreed = false;
};

Sample sweep_pixel(std::span<const SmallPhoto> photos,
                   const std::vector<std::vector<std::size_t>>& neighbours,
                   const DepthRange& depths,
                   std::uint64_t seed,
                   std::size_t index) {
  CounterRng rng(seed, kSweepStream, 8 * index);
  const std::size_t view = rng.below(photos.size());
  const SmallPhoto& photo = photos[view];
  const glm::dvec2 pixel(rng.uniform() * photo.camera.width, rng.uniform() * photo.camera.height);
  const double jitter = rng.uniform();
  const CameraRay ray = camera_ray(photo.camera, pixel.x, pixel.y);
  const glm::dvec4 color = photo.at(pixel);
  Sample out;
  out.color = glm::dvec3(color);
  if (!ray.valid || color.w < 0.5) return out;
  const auto depth = agreed_depth(photos, neighbours[view], ray, patch_at(photo, pixel), depths);
  out.agreed = depth.has_value();
  const double along = depth ? *depth : depth_at(0.4 + 0.6 * jitter, depths);
  out.position = ray.origin + along * ray.direction;
  return out;
}

}  // namespace

PointCloud carved_points(std::span<const SmallPhoto> photos,
                         const Region& region,
                         std::size_t count,
                         std::uint64_t seed) {
  CounterRng rng(seed, kCarveStream);
  PointCloud out;
  std::vector<glm::dvec3> colors;
  for (std::size_t tried = 0; out.size() < count && tried < kTriesPerPoint * count; ++tried) {
    glm::dvec3 world;
    for (int a = 0; a < 3; ++a)
      world[a] = region.center[a] + region.half_side * (2.0 * rng.uniform() - 1.0);
    colors.clear();
    bool inside = true;
    for (const SmallPhoto& photo : photos) {
      const auto point = photo.sees(world);
      // What a mask ignores says neither that something is there nor that nothing is.
      if (!point || !photo.known(*point)) continue;
      inside = shows_something(photo, *point);
      if (!inside) break;
      const glm::dvec4 color = photo.at(*point);
      if (color.w > 0.5) colors.emplace_back(color);
    }
    if (inside && !colors.empty()) append(out, world, median_color(colors));
  }
  return out;
}

PointCloud swept_points(std::span<const SmallPhoto> photos,
                        const DepthRange& depths,
                        std::size_t count,
                        double unsure,
                        std::uint64_t seed) {
  std::vector<std::vector<std::size_t>> neighbours(photos.size());
  for (std::size_t i = 0; i < photos.size(); ++i)
    neighbours[i] = neighbours_of(photos, i, depths.typical);
  const std::size_t tries = 4 * count;
  std::vector<Sample> samples(tries);
  {
    const std::size_t threads = std::max(1u, std::thread::hardware_concurrency());
    std::vector<std::jthread> workers;
    for (std::size_t t = 0; t < threads; ++t) {
      workers.emplace_back([&, t] {
        for (std::size_t i = t; i < tries; i += threads)
          samples[i] = sweep_pixel(photos, neighbours, depths, seed, i);
      });
    }
  }
  const auto fog = static_cast<std::size_t>(unsure * static_cast<double>(count));
  PointCloud out;
  std::size_t agreed = 0, random = 0;
  for (const Sample& sample : samples) {
    std::size_t& number = sample.agreed ? agreed : random;
    if (number >= (sample.agreed ? count - fog : fog) || sample.position == glm::dvec3(0.0))
      continue;
    ++number;
    append(out, sample.position, sample.color);
  }
  return out;
}

}  // namespace raysplats
