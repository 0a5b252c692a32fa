// SPDX-License-Identifier: Apache-2.0
#include "train/start/point_check.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <limits>
#include <vector>

#include "scene/camera/camera_model.hpp"
#include "scene/even_choice.hpp"
#include "train/start/photo_cells.hpp"
#include "train/start/point_cloud.hpp"
#include "util/parallel.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kLooks = 2000;    // points that are looked at
constexpr std::size_t kFewLooks = 100;  // that the photos see; fewer tell nothing
constexpr double kLeastSeen = 0.3;
constexpr double kMostDifference = 0.77;
constexpr double kSound = 0.1;              // of points that are where they belong
constexpr double kClearlyBetter = 0.6;      // at another scale
constexpr std::size_t kFewerLooks = 500;    // at every scale
constexpr int kScaleSteps = 20;             // of half an octave, up and down
constexpr float kOneColor = 0.004f;         // no two of 256 steps apart
constexpr std::size_t kMostPlaces = 20000;  // of points that hide others
constexpr std::size_t kFewerPlaces = 2000;  // at every scale
constexpr int kNearCell = 10;               // pixels a side of what is near a point
constexpr double kBehind = 1.15;            // times as far as the nearest in a cell: hidden
constexpr double kEvenColors = 1e-4;        // squared difference of points that tell nothing

// A photo, and how far away the nearest of `looks` of the points is in each of its cells: those of
// a scan lie on all sides of things, and a photo shows what is before them.
class PhotoBeforePoints {
 public:
  PhotoBeforePoints(const PointCloud& points,
                    const SmallPhoto& photo,
                    std::size_t looks,
                    double scale)
      : photo_(&photo),
        cells_(photo, kNearCell),
        nearest_(cells_.count(), std::numeric_limits<double>::infinity()) {
    for (const std::size_t i : even_choice(points.size(), looks)) {
      const glm::dvec3 world = scale * triple(points.positions, i);
      const auto place = photo.sees(world);
      if (!place) continue;
      double& nearest = nearest_[cells_.at(*place)];
      nearest = std::min(nearest, distance(world));
    }
  }

  /// What the photo shows where the point is, unless another hides it.
  std::optional<glm::dvec3> color(const glm::dvec3& world) const {
    const auto place = photo_->sees(world);
    if (!place || !photo_->known(*place)) return std::nullopt;
    const glm::dvec4 shown = photo_->at(*place);
    if (shown.w < 0.5 || distance(world) > kBehind * nearest_[cells_.at(*place)])
      return std::nullopt;
    return glm::dvec3(shown);
  }

 private:
  double distance(const glm::dvec3& world) const {
    return glm::distance(world, photo_->camera.center());
  }

  const SmallPhoto* photo_;
  PhotoCells cells_;
  std::vector<double> nearest_;
};

// Mean of the lower half, of two at least: something may hide the point from the others.
double better_half(std::vector<double>& differences) {
  const std::size_t half = std::max<std::size_t>(2, (differences.size() + 1) / 2);
  std::partial_sort(differences.begin(), differences.begin() + static_cast<std::ptrdiff_t>(half),
                    differences.end());
  double sum = 0;
  for (std::size_t i = 0; i < half; ++i) sum += differences[i];
  return sum / static_cast<double>(half);
}

// PointMatch::difference of `count` of the points, moved by a factor about the world's origin;
// `hiding`: as many may hide others.
std::optional<double> color_difference(const PointCloud& points,
                                       std::span<const SmallPhoto> photos,
                                       std::size_t count,
                                       std::size_t hiding,
                                       double scale) {
  std::vector<PhotoBeforePoints> shown;
  for (const SmallPhoto& photo : photos) shown.emplace_back(points, photo, hiding, scale);
  std::size_t looks = 0;
  double own_sum = 0, other_sum = 0, apart = 0;
  std::vector<double> own, other;
  const std::vector<std::size_t> chosen = even_choice(points.size(), count);
  for (std::size_t k = 0; k < chosen.size(); ++k) {
    const std::size_t i = chosen[k];
    const glm::dvec3 world = scale * triple(points.positions, i);
    // The colour of a point half the cloud away.
    const std::size_t j = chosen[(k + chosen.size() / 2) % chosen.size()];
    const glm::dvec3 color = triple(points.colors, i), wrong = triple(points.colors, j);
    own.clear(), other.clear();
    for (const PhotoBeforePoints& photo : shown) {
      const std::optional<glm::dvec3> there = photo.color(world);
      if (!there) continue;
      const glm::dvec3 a = color - *there, b = wrong - *there;
      own.push_back(glm::dot(a, a)), other.push_back(glm::dot(b, b));
    }
    // Along the ray of one photo every depth fits.
    if (own.size() < 2) continue;
    ++looks;
    own_sum += better_half(own), other_sum += better_half(other);
    apart += glm::dot(color - wrong, color - wrong);
  }
  if (looks < kFewLooks || apart <= kEvenColors * static_cast<double>(looks)) return std::nullopt;
  return own_sum / other_sum;
}

}  // namespace

double seen_share(const std::vector<float>& positions, std::span<const Camera> cameras) {
  const std::vector<std::size_t> chosen = even_choice(positions.size() / 3, kLooks);
  if (chosen.empty()) return 0;
  std::size_t seen = 0;
  for (const std::size_t i : chosen) {
    const glm::dvec3 world = triple(positions, i);
    seen +=
        std::any_of(cameras.begin(), cameras.end(),
                    [&](const Camera& camera) { return project_into(camera, world).has_value(); })
            ? 1
            : 0;
  }
  return static_cast<double>(seen) / static_cast<double>(chosen.size());
}

PointMatch match_points(const PointCloud& points,
                        std::span<const Camera> cameras,
                        std::span<const SmallPhoto> photos) {
  PointMatch out;
  const std::size_t count = std::min(kLooks, points.size());
  if (count == 0) return out;
  out.seen = seen_share(points.positions, cameras);
  out.difference = color_difference(points, photos, count, kMostPlaces, 1.0);
  if (!out.difference) return out;
  out.scaled_difference = *out.difference;
  const std::size_t few = std::min(kFewerLooks, count);
  for (int step = -kScaleSteps; step <= kScaleSteps; ++step) {
    const double scale = std::exp2(0.5 * step);
    const std::optional<double> other = color_difference(points, photos, few, kFewerPlaces, scale);
    if (step == 0 || !other || *other >= out.scaled_difference) continue;
    out.scale = scale;
    out.scaled_difference = *other;
  }
  return out;
}

PointCloud seen_points(const PointCloud& points, std::span<const Camera> cameras) {
  std::vector<std::uint8_t> seen(points.size());
  in_parallel(points.size(), [&](std::size_t i) {
    const glm::dvec3 world = triple(points.positions, i);
    seen[i] = std::any_of(cameras.begin(), cameras.end(), [&](const Camera& camera) {
      return project_into(camera, world).has_value();
    });
  });
  PointCloud out;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (seen[i]) append_point(points, i, out);
  }
  return out;
}

bool colorless(const PointCloud& points) {
  for (std::size_t i = 3; i < points.colors.size(); ++i) {
    if (std::abs(points.colors[i] - points.colors[i % 3]) > kOneColor) return false;
  }
  return points.size() > 1;
}

PointCloud colored_by_photos(PointCloud points, std::span<const SmallPhoto> photos) {
  std::array<std::vector<double>, 3> shown;
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::vector<double>& channel : shown) channel.clear();
    const glm::dvec3 world = triple(points.positions, i);
    for (const SmallPhoto& photo : photos) {
      const std::optional<glm::dvec2> place = photo.sees(world);
      if (!place || !photo.known(*place)) continue;
      const glm::dvec4 color = photo.at(*place);
      if (color.w < 0.5) continue;
      for (std::size_t k = 0; k < 3; ++k) shown[k].push_back(color[static_cast<int>(k)]);
    }
    for (std::size_t k = 0; k < 3; ++k) {
      const auto middle = static_cast<std::ptrdiff_t>(shown[k].size() / 2);
      std::nth_element(shown[k].begin(), shown[k].begin() + middle, shown[k].end());
      points.colors[3 * i + k] =
          shown[k].empty() ? 0.5f : static_cast<float>(shown[k][static_cast<std::size_t>(middle)]);
    }
  }
  return points;
}

bool plausible(const PointMatch& match) {
  const double difference = match.difference.value_or(0);
  // Small points on the black between lamps have the photos' colours as well.
  const bool in_place =
      difference <= kSound || match.scaled_difference >= kClearlyBetter * difference;
  return match.seen >= kLeastSeen && difference <= kMostDifference && in_place;
}

}  // namespace raysplats
