// SPDX-License-Identifier: Apache-2.0
#include "train/start/point_cover.hpp"

#include <algorithm>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "scene/even_choice.hpp"
#include "train/start/depth_range.hpp"
#include "train/start/photo_cells.hpp"
#include "train/start/photo_pixel.hpp"
#include "train/start/point_cloud.hpp"
#include "util/rng.hpp"

namespace raysplats {
namespace {

// Random streams of one seed are told apart by a constant.
constexpr std::uint64_t kUncoveredStream = 0x756e636f76;
constexpr std::size_t kMostPlaces = 20000;  // of points that fill cells
constexpr int kNearCell = 10;               // pixels a side of what is near a point
constexpr int kWideCells = 7;               // along a photo's longer side
constexpr float kLeastStep = 12.0f / 255;   // between the neighbours of a pixel at an edge
constexpr double kLeastEdges = 0.05;        // of the pixels of a cell that has texture

// Pixels a side of a wide place.
int wide_cell(const SmallPhoto& photo) {
  return std::max(1, std::max(photo.camera.width, photo.camera.height) / kWideCells);
}

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
  PhotoCells cells_;
  std::vector<bool> taken_;
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

}  // namespace

double bare_share(const PointCloud& points, std::span<const SmallPhoto> photos) {
  struct Count {
    std::size_t shown = 0, bare = 0;
  };
  Count textured, even;
  for (const SmallPhoto& photo : photos) {
    const int width = photo.camera.width, height = photo.camera.height;
    const int side = wide_cell(photo);
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

PointCloud uncovered_points(const PointCloud& points,
                            std::span<const SmallPhoto> photos,
                            double typical,
                            std::size_t looks,
                            std::uint64_t seed) {
  std::vector<PointCells> cells;
  for (const SmallPhoto& photo : photos) cells.emplace_back(points, photo, wide_cell(photo));
  PointCloud out;
  for (std::size_t i = 0; !photos.empty() && i < looks; ++i) {
    CounterRng rng(seed, kUncoveredStream, 8 * i);
    const PhotoPixel pixel = random_pixel(photos, rng);
    const double depth = unknown_depth(typical, rng.uniform());
    const bool counts = pixel.shows() && photos[pixel.view].known(pixel.point);
    if (!counts || cells[pixel.view].taken(pixel.point)) continue;
    append_point(out, pixel.ray.origin + depth * pixel.ray.direction, glm::dvec3(pixel.color));
  }
  return out;
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

}  // namespace raysplats
