// SPDX-License-Identifier: Apache-2.0
#include "train/start/still_marks.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <map>
#include <optional>
#include <utility>

#include "scene/camera/camera_model.hpp"
#include "scene/statistics.hpp"
#include "train/capture_geometry.hpp"
#include "train/start/depth_range.hpp"
#include "util/parallel.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kLeastPhotos = 12;
// Difference of a channel between the neighbours on either side, along the edge's direction. Noise
// of JPEG has less.
constexpr float kLeastStep = 12.0f / 255;
constexpr std::size_t kOddOneIn = 10;  // photos in which an edge may be another
constexpr int kReach = 6;              // pixels between edges of one mark
// Unaltered captures had up to 3 such pixels together, and 10 with half as many photos; logos of
// 10 % x 5 % 160 and more, dates of letters 3 % high 60 and more.
constexpr std::size_t kLeastEdges = 40;
constexpr double kLeastFacing = 0.08;  // of the edges, to each of four sides
constexpr double kMostArea = 0.05;     // of the photo
// What may be a thing of the scene is seen within so much of the longer side, in half of the
// photos, at one of so many depths from near to far, in extents.
constexpr double kNearPlace = 0.015;
constexpr double kSeenThere = 0.5;
constexpr std::size_t kDepths = 200;
constexpr double kRim = 2;  // pixels around a mark, whose edges are the clearest of it alone
constexpr int kSteps = 8;   // places along a side
// A ground that stands still.
constexpr std::size_t kAlikePhotos = 5;
constexpr double kAlike = 0.3;      // of a photo's edges, that another has at the same pixels
constexpr float kOtherStep = 0.6f;  // of an edge's step, by which the other's may differ
constexpr double kGround = 0.15;    // of a photo's edges, that all alike photos have
// Outlines of what is round stand still as well, but on lines: so of cells of so many to the longer
// side a share has still edges.
constexpr int kCells = 40;
constexpr double kGroundCells = 0.12;
constexpr std::size_t kPlaces = 300;  // pixels that are asked for a place where rays meet
constexpr double kNearest = 0.01, kFarthest = 1e4;

struct Edge {
  bool found = false;
  glm::vec2 step{0.0f};  // the typical one
};

// What a channel of a photo's pixel differs from left to right and from top to bottom.
glm::vec2 step_at(const io::Photo& photo, int x, int y, std::size_t channel) {
  const auto value = [&](int i, int j) -> std::optional<float> {
    const std::array<float, 4> rgba = photo.at(i, j);
    if (rgba[3] < 0.5f || photo.weight(i, j) < 0.5f) return std::nullopt;
    return rgba[channel];
  };
  const auto left = value(x - 1, y), right = value(x + 1, y);
  const auto above = value(x, y - 1), below = value(x, y + 1);
  // What masks leave out tells of no edge.
  if (!left || !right || !above || !below) return glm::vec2(0.0f);
  return {*right - *left, *below - *above};
}

float middle_of(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

// The steps of a channel in all photos; false, and not all of them, where too many are no edge.
bool are_edges(std::span<const SmallPhoto> photos,
               int x,
               int y,
               std::size_t channel,
               std::vector<glm::vec2>& steps) {
  std::size_t odd = 0;
  for (std::size_t i = 0; i < photos.size(); ++i) {
    steps[i] = step_at(*photos[i].picture, x, y, channel);
    odd += glm::length(steps[i]) < kLeastStep ? 1 : 0;
    if (odd * kOddOneIn > photos.size()) return false;
  }
  return true;
}

// What the search at a pixel works with.
struct Steps {
  std::vector<glm::vec2> steps;
  std::vector<float> values;
  explicit Steps(std::size_t photos) : steps(photos), values(photos) {}
};

// An edge that most photos have there.
Edge common_edge(std::span<const SmallPhoto> photos, int x, int y, Steps& work) {
  auto& [steps, values] = work;
  for (std::size_t channel = 0; channel < 3; ++channel) {
    if (!are_edges(photos, x, y, channel, steps)) continue;
    glm::vec2 typical;
    for (const int axis : {0, 1}) {
      for (std::size_t i = 0; i < steps.size(); ++i) values[i] = steps[i][axis];
      typical[axis] = middle_of(values);
    }
    const float size = glm::length(typical);
    if (size < kLeastStep) continue;
    std::size_t odd = 0;
    for (const glm::vec2& step : steps) odd += glm::dot(step, typical) < kLeastStep * size ? 1 : 0;
    if (odd * kOddOneIn <= photos.size()) return {true, typical};
  }
  return {};
}

// The edges of one mark.
struct Cluster {
  StillMark mark;
  std::array<std::size_t, 4> facing{};  // right, left, down, up

  void add(int x, int y, const glm::vec2& step) {
    if (mark.edges++ == 0) mark.low = mark.high = {x, y};
    mark.low = {std::min(mark.low.x, x), std::min(mark.low.y, y)};
    mark.high = {std::max(mark.high.x, x), std::max(mark.high.y, y)};
    const bool across = std::abs(step.x) > std::abs(step.y);
    ++facing[across ? (step.x > 0 ? 0 : 1) : (step.y > 0 ? 2 : 3)];
  }
  bool is_closed() const {
    return *std::min_element(facing.begin(), facing.end()) >=
           kLeastFacing * static_cast<double>(mark.edges);
  }
};

// Edges that lie near to each other.
std::vector<Cluster> clusters_of(std::vector<Edge> edges, int width, int height) {
  std::vector<Cluster> out;
  std::vector<std::pair<int, int>> open;
  const auto take = [&](int x, int y) {
    Edge& edge = edges[static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
                       static_cast<std::size_t>(x)];
    if (!std::exchange(edge.found, false)) return;
    out.back().add(x, y, edge.step);
    open.emplace_back(x, y);
  };
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      out.emplace_back();
      take(x, y);
      while (!open.empty()) {
        const auto [i, j] = open.back();
        open.pop_back();
        for (int v = std::max(0, j - kReach); v <= std::min(height - 1, j + kReach); ++v) {
          for (int u = std::max(0, i - kReach); u <= std::min(width - 1, i + kReach); ++u)
            take(u, v);
        }
      }
      if (out.back().mark.edges < kLeastEdges) out.pop_back();
    }
  }
  return out;
}

// Whether a thing of the scene may be seen at the same place of most photos.
bool may_be_seen(std::span<const SmallPhoto> photos, const glm::dvec2& place, double extent) {
  const CameraRay ray = camera_ray(photos.front().camera, place.x, place.y);
  if (!ray.valid) return true;
  const Camera& camera = photos.front().camera;
  const double near = kNearPlace * std::max(camera.width, camera.height);
  const DepthRange depths{kNearest * extent, extent, kFarthest * extent, false};
  for (std::size_t step = 0; step < kDepths; ++step) {
    const glm::dvec3 world = ray.origin + depths.at(step, kDepths) * ray.direction;
    std::size_t there = 0;
    for (const SmallPhoto& photo : photos) {
      const auto seen = photo.sees(world);
      there += seen && glm::distance(*seen, place) <= near ? 1 : 0;
    }
    if (static_cast<double>(there) >= kSeenThere * static_cast<double>(photos.size())) return true;
  }
  return false;
}

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

// The share of a photo's cells that have one of these pixels.
double cells_with(std::span<const std::size_t> pixels, int width, int height) {
  const int side = std::max(1, std::max(width, height) / kCells);
  const int across = (width + side - 1) / side, down = (height + side - 1) / side;
  std::vector<char> has(static_cast<std::size_t>(across) * static_cast<std::size_t>(down), 0);
  for (const std::size_t pixel : pixels) {
    const auto x = static_cast<int>(pixel % static_cast<std::size_t>(width));
    const auto y = static_cast<int>(pixel / static_cast<std::size_t>(width));
    has[static_cast<std::size_t>(y / side) * static_cast<std::size_t>(across) +
        static_cast<std::size_t>(x / side)] = 1;
  }
  return static_cast<double>(std::count(has.begin(), has.end(), 1)) /
         static_cast<double>(has.size());
}

// The photo with the most others like it, and these.
std::vector<std::size_t> alike_photos(std::span<const std::vector<glm::vec2>> edges) {
  std::vector<std::vector<std::size_t>> groups(edges.size());
  in_parallel(edges.size(), [&](std::size_t i) {
    for (std::size_t j = 0; j < edges.size(); ++j) {
      if (j == i || shared_edges(edges[i], edges[j]) >= kAlike) groups[i].push_back(j);
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
  std::vector<Camera> cameras;
  cameras.reserve(photos.size());
  for (const SmallPhoto& photo : photos) cameras.push_back(photo.camera);
  const double extent = camera_extent(cameras);
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

// The photos of the size that most have.
std::vector<SmallPhoto> of_one_size(std::span<const SmallPhoto> photos) {
  std::map<std::pair<int, int>, std::vector<SmallPhoto>> sizes;
  for (const SmallPhoto& photo : photos)
    sizes[{photo.picture->width, photo.picture->height}].push_back(photo);
  if (sizes.empty()) return {};
  return std::max_element(
             sizes.begin(), sizes.end(),
             [](const auto& a, const auto& b) { return a.second.size() < b.second.size(); })
      ->second;
}

// Where a photo shows what a picture of it shows at a place, in shares of its sides.
std::optional<glm::dvec2> share_seen(const Camera& picture,
                                     const glm::dvec2& place,
                                     const Camera& photo) {
  const CameraRay ray = camera_ray(picture, place.x, place.y);
  if (!ray.valid) return std::nullopt;
  const auto seen = project(photo, ray.origin + ray.direction);
  return seen ? std::optional(*seen / glm::dvec2(photo.width, photo.height)) : std::nullopt;
}

}  // namespace

PhotoArea area_of(const StillMark& mark, const Camera& picture, const Camera& photo) {
  const glm::dvec2 picture_size(picture.width, picture.height);
  const glm::dvec2 low = glm::max(glm::dvec2(mark.low) - kRim, 0.0);
  const glm::dvec2 high = glm::min(glm::dvec2(mark.high + 1) + kRim, picture_size);
  // No lens comes between panoramas, whose edges all lie in one place.
  const bool around = picture.model == CameraModel::kEquirectangular;
  glm::dvec2 least(1.0), most(0.0);
  // A lens bends the sides of the box.
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) {
      const glm::dvec2 place = glm::mix(low, high, glm::dvec2(i, j) / double{kSteps});
      const glm::dvec2 same = place / picture_size;
      const glm::dvec2 seen = around ? same : share_seen(picture, place, photo).value_or(same);
      least = glm::min(least, seen);
      most = glm::max(most, seen);
    }
  }
  constexpr double kParts = 1000, kRounding = 1e-6;
  least = glm::floor(glm::clamp(least, 0.0, 1.0) * kParts + kRounding) / kParts;
  most = glm::ceil(glm::clamp(most, 0.0, 1.0) * kParts - kRounding) / kParts;
  return {least.x, least.y, most.x, most.y};
}

std::vector<StillMark> still_marks(std::span<const SmallPhoto> all) {
  const std::vector<SmallPhoto> photos = of_one_size(all);
  if (photos.size() < kLeastPhotos) return {};
  const int width = photos.front().picture->width, height = photos.front().picture->height;
  std::vector<Edge> edges(photos.front().picture->pixels());
  in_parallel(static_cast<std::size_t>(height), [&](std::size_t row) {
    const int y = static_cast<int>(row);
    if (y == 0 || y == height - 1) return;
    Steps work(photos.size());
    for (int x = 1; x < width - 1; ++x) {
      edges[row * static_cast<std::size_t>(width) + static_cast<std::size_t>(x)] =
          common_edge(photos, x, y, work);
    }
  });
  std::vector<Camera> cameras;
  cameras.reserve(photos.size());
  for (const SmallPhoto& photo : photos) cameras.push_back(photo.camera);
  const double extent = camera_extent(cameras);
  std::vector<StillMark> out;
  for (const Cluster& cluster : clusters_of(std::move(edges), width, height)) {
    const StillMark& mark = cluster.mark;
    const glm::dvec2 size = mark.high - mark.low + 1;
    if (!cluster.is_closed() || size.x * size.y > kMostArea * width * height) continue;
    if (may_be_seen(photos, glm::dvec2(mark.low) + 0.5 * size, extent)) continue;
    out.push_back(mark);
    out.back().size = {width, height};
  }
  std::sort(out.begin(), out.end(),
            [](const StillMark& a, const StillMark& b) { return a.edges > b.edges; });
  return out;
}

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
  const io::Photo& picture = *group.front().picture;
  if (apart < kGround || cells_with(still, picture.width, picture.height) < kGroundCells)
    return std::nullopt;
  return StillGround{group.size(), apart};
}

}  // namespace raysplats
