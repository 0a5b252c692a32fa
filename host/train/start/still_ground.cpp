// SPDX-License-Identifier: Apache-2.0
#include "train/start/still_ground.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <vector>

#include "train/start/still_photos.hpp"
#include "util/parallel.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kAlikePhotos = 5;
constexpr double kAlike = 0.3;      // of a photo's edges, that another has at the same pixels
constexpr float kOtherStep = 0.6f;  // of an edge's step, by which the other's may differ
constexpr double kGround = 0.15;    // of a photo's edges, that all alike photos have
// Rings and outlines of what is round stand still as well, with one direction at each place: so a
// share of cells, as many to the longer side, has still edges of two directions (of a vase with
// grooves less than a tenth, of textures three quarters).
constexpr int kCells = 20;
constexpr int kLeastSide = 10;  // pixels of a cell
constexpr double kGroundCells = 0.12;
constexpr double kCellEdges = 8;
constexpr double kAcross = 0.15;      // of the edges' squares, those across the main direction
constexpr std::size_t kPlaces = 300;  // pixels that are asked for a place where rays meet

// The steps of a photo's brightness, as its second channel shows it; zero where there is no edge.
std::vector<glm::vec2> edges_of(const SmallPhoto& photo) {
  const io::Photo& picture = *photo.picture;
  std::vector<glm::vec2> out(picture.pixels(), glm::vec2(0.0f));
  for (int y = 1; y < picture.height - 1; ++y) {
    for (int x = 1; x < picture.width - 1; ++x) {
      const glm::vec2 step = step_at(picture, x, y, 1);
      if (glm::length(step) >= kLeastStep)
        out[static_cast<std::size_t>(y) * static_cast<std::size_t>(picture.width) +
            static_cast<std::size_t>(x)] = step;
    }
  }
  return out;
}

bool is_edge(const glm::vec2& step) { return step.x != 0.0f || step.y != 0.0f; }

bool has_edge(const glm::vec2& own, const glm::vec2& other) {
  return glm::distance(own, other) <= kOtherStep * glm::length(own);
}

// The share of a photo's edges that another one has at the same pixels.
double shared_edges(std::span<const glm::vec2> own, std::span<const glm::vec2> other) {
  std::size_t all = 0, same = 0;
  for (std::size_t i = 0; i < own.size(); ++i) {
    if (!is_edge(own[i])) continue;
    ++all;
    same += has_edge(own[i], other[i]) ? 1 : 0;
  }
  return all == 0 ? 0.0 : static_cast<double>(same) / static_cast<double>(all);
}

// The still edges of a cell: their number and the products of their directions.
struct Cell {
  double edges = 0;
  glm::dvec2 squares{0.0};
  double product = 0;

  void add(const glm::vec2& step) {
    const glm::dvec2 direction = glm::normalize(glm::dvec2(step));
    edges += 1;
    squares += direction * direction;
    product += direction.x * direction.y;
  }
  // Its smaller eigenvalue says how much lies across the main direction.
  bool has_two_directions() const {
    const double apart = std::hypot(squares.x - squares.y, 2 * product);
    return edges >= kCellEdges && edges - apart >= 2 * kAcross * edges;
  }
};

// The share of cells in which these edges have two directions.
double textured_cells(std::span<const glm::vec2> edges,
                      std::span<const std::size_t> pixels,
                      const io::Photo& picture) {
  const int side = std::max(kLeastSide, std::max(picture.width, picture.height) / kCells);
  const auto across = static_cast<std::size_t>((picture.width + side - 1) / side);
  const auto down = static_cast<std::size_t>((picture.height + side - 1) / side);
  const auto width = static_cast<std::size_t>(picture.width), step = static_cast<std::size_t>(side);
  std::vector<Cell> cells(across * down);
  for (const std::size_t pixel : pixels)
    cells[pixel / width / step * across + pixel % width / step].add(edges[pixel]);
  return static_cast<double>(std::count_if(cells.begin(), cells.end(),
                                           [](const Cell& c) { return c.has_two_directions(); })) /
         static_cast<double>(cells.size());
}

// The photo with the most others like it, and then these.
std::vector<std::size_t> alike_photos(std::span<const std::vector<glm::vec2>> edges) {
  std::vector<std::vector<std::size_t>> groups(edges.size());
  in_parallel(edges.size(), [&](std::size_t i) {
    groups[i] = {i};
    for (std::size_t j = 0; j < edges.size(); ++j) {
      if (j != i && shared_edges(edges[i], edges[j]) >= kAlike) groups[i].push_back(j);
    }
  });
  if (groups.empty()) return {};
  return *std::max_element(groups.begin(), groups.end(),
                           [](const auto& a, const auto& b) { return a.size() < b.size(); });
}

// Pixels of edges that (nearly) all of these photos have as the first of them has.
std::vector<std::size_t> still_edges(std::span<const std::vector<glm::vec2>> edges,
                                     std::span<const std::size_t> alike) {
  const std::vector<glm::vec2>& first = edges[alike.front()];
  std::vector<std::size_t> out;
  for (std::size_t pixel = 0; pixel < first.size(); ++pixel) {
    if (!is_edge(first[pixel])) continue;
    std::size_t odd = 0;
    for (const std::size_t i : alike) odd += has_edge(first[pixel], edges[i][pixel]) ? 0 : 1;
    if (odd * kOddOneIn <= alike.size()) out.push_back(pixel);
  }
  return out;
}

// The share of some of these pixels at which no thing of the scene may be seen in most photos.
double share_apart(std::span<const SmallPhoto> photos, std::span<const std::size_t> pixels) {
  const double extent = extent_of(photos);
  const auto width = static_cast<std::size_t>(photos.front().picture->width);
  std::vector<char> apart(std::min(kPlaces, pixels.size()), 0);
  in_parallel(apart.size(), [&](std::size_t i) {
    const std::size_t pixel = pixels[i * pixels.size() / apart.size()];
    const std::size_t x = pixel % width, y = pixel / width;
    const glm::dvec2 middle = glm::dvec2(x, y) + 0.5;
    apart[i] = may_be_seen(photos, middle, extent) ? 0 : 1;
  });
  return static_cast<double>(std::count(apart.begin(), apart.end(), 1)) /
         static_cast<double>(apart.size());
}

}  // namespace

std::optional<StillGround> still_ground(std::span<const SmallPhoto> all) {
  const std::vector<SmallPhoto> photos = of_one_size(all);
  std::vector<std::vector<glm::vec2>> edges(photos.size());
  in_parallel(photos.size(), [&](std::size_t i) { edges[i] = edges_of(photos[i]); });
  const std::vector<std::size_t> alike = alike_photos(edges);
  if (alike.size() < kAlikePhotos) return std::nullopt;
  const std::vector<std::size_t> still = still_edges(edges, alike);
  if (still.empty()) return std::nullopt;
  std::vector<SmallPhoto> group;
  group.reserve(alike.size());
  for (const std::size_t i : alike) group.push_back(photos[i]);
  const std::vector<glm::vec2>& first = edges[alike.front()];
  const double share = static_cast<double>(still.size()) /
                       static_cast<double>(std::count_if(first.begin(), first.end(), is_edge));
  const double apart = share * share_apart(group, still);
  if (apart < kGround || textured_cells(first, still, *group.front().picture) < kGroundCells)
    return std::nullopt;
  return StillGround{group.size(), apart};
}

}  // namespace raysplats
