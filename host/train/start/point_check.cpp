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
constexpr std::size_t kMostPlaces = 20000;  // of points that fill cells, or hide others
constexpr std::size_t kFewerPlaces = 2000;  // at every scale
constexpr int kNearCell = 10;               // pixels a side of what is near a point
constexpr int kBareCells = 7;               // along a photo's longer side
constexpr float kLeastStep = 12.0f / 255;   // between the neighbours of a pixel at an edge
constexpr double kLeastEdges = 0.05;        // of the pixels of a cell that has texture
constexpr double kBehind = 1.15;            // times as far as the nearest in a cell: hidden
constexpr double kEvenColors = 1e-4;        // squared difference of points that tell nothing

glm::dvec3 triple(const std::vector<float>& values, std::size_t i) {
  return {values[3 * i], values[3 * i + 1], values[3 * i + 2]};
}

// Square cells of a photo, as far as they lie inside.
class Cells {
 public:
  Cells(const SmallPhoto& photo, int side)
      : side_(side),
        columns_((photo.camera.width + side - 1) / side),
        rows_((photo.camera.height + side - 1) / side) {}

  std::size_t count() const {
    return static_cast<std::size_t>(columns_) * static_cast<std::size_t>(rows_);
  }

  /// The one that contains the image point, which has to lie inside.
  std::size_t at(const glm::dvec2& place) const {
    const auto along = [this](double x, int cells) {
      return static_cast<std::size_t>(std::min(static_cast<int>(x) / side_, cells - 1));
    };
    return along(place.y, rows_) * static_cast<std::size_t>(columns_) + along(place.x, columns_);
  }

 private:
  int side_, columns_, rows_;
};

// Which cells of a photo show points.
class PointCells {
 public:
  PointCells(const PointCloud& points, const SmallPhoto& photo, int side)
      : cells_(photo, side), taken_(cells_.count()) {
    for (const std::size_t i : even_choice(points.size(), kMostPlaces)) {
      const auto place = photo.sees(triple(points.positions, i));
      if (place) taken_[cells_.at(*place)] = true;
    }
  }

  /// Whether the cell that contains the image point shows one; the point has to lie inside.
  bool taken(const glm::dvec2& place) const { return taken_[cells_.at(place)]; }

 private:
  Cells cells_;
  std::vector<bool> taken_;
};

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
  Cells cells_;
  std::vector<double> nearest_;
};

// Whether the square around the middle has edges that points can be found at; a white wall has
// none.
bool is_textured(const SmallPhoto& photo, const glm::dvec2& middle, int side) {
  const int left = std::max(1, static_cast<int>(middle.x) - side / 2);
  const int top = std::max(1, static_cast<int>(middle.y) - side / 2);
  const int right = std::min(left + side, photo.camera.width - 1);
  const int bottom = std::min(top + side, photo.camera.height - 1);
  std::size_t pixels = 0, edges = 0;
  for (int y = top; y < bottom; ++y) {
    for (int x = left; x < right; ++x) {
      glm::vec2 step(0.0f);
      for (std::size_t c = 0; c < 3; ++c) {
        step.x += photo.color(x + 1, y)[c] - photo.color(x - 1, y)[c];
        step.y += photo.color(x, y + 1)[c] - photo.color(x, y - 1)[c];
      }
      ++pixels;
      edges += glm::length(step) >= 3 * kLeastStep ? 1 : 0;
    }
  }
  return static_cast<double>(edges) >=
         kLeastEdges * static_cast<double>(std::max<std::size_t>(pixels, 1));
}

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

double bare_share(const PointCloud& points, std::span<const SmallPhoto> photos) {
  struct Count {
    std::size_t shown = 0, bare = 0;
  };
  Count textured, even;
  for (const SmallPhoto& photo : photos) {
    const int width = photo.camera.width, height = photo.camera.height;
    const int side = std::max(1, std::max(width, height) / kBareCells);
    const PointCells cells(points, photo, side);
    for (double y = 0.5 * std::min(side, height); y < height; y += side) {
      for (double x = 0.5 * std::min(side, width); x < width; x += side) {
        const glm::dvec2 middle(x, y);
        if (!photo.known(middle) || photo.at(middle).w < 0.5) continue;
        Count& count = is_textured(photo, middle, side) ? textured : even;
        ++count.shown;
        count.bare += cells.taken(middle) ? 0 : 1;
      }
    }
  }
  // Photos without any texture tell no more than where points are.
  const auto [shown, bare] = textured.shown > 0 ? textured : even;
  return shown > 0 ? static_cast<double>(bare) / static_cast<double>(shown) : 0;
}

PointCloud beside_points(const PointCloud& found,
                         const PointCloud& points,
                         std::span<const SmallPhoto> photos) {
  std::vector<PointCells> cells;
  for (const SmallPhoto& photo : photos) cells.emplace_back(points, photo, kNearCell);
  PointCloud out;
  for (std::size_t i = 0; i < found.size(); ++i) {
    std::size_t seen = 0, taken = 0;
    for (std::size_t k = 0; k < photos.size(); ++k) {
      const auto place = photos[k].sees(triple(found.positions, i));
      if (!place) continue;
      ++seen;
      taken += cells[k].taken(*place) ? 1 : 0;
    }
    if (seen > 0 && 2 * taken >= seen) append_point(found, i, out);
  }
  return out;
}

bool plausible(const PointMatch& match) {
  const double difference = match.difference.value_or(0);
  // Small points on the black between lamps have the photos' colours as well.
  const bool in_place =
      difference <= kSound || match.scaled_difference >= kClearlyBetter * difference;
  return match.seen >= kLeastSeen && difference <= kMostDifference && in_place;
}

}  // namespace raysplats
