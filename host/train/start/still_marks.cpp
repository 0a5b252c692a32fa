// SPDX-License-Identifier: Apache-2.0
#include "train/start/still_marks.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <optional>
#include <utility>

#include "scene/camera/camera_model.hpp"
#include "scene/statistics.hpp"
#include "train/start/still_photos.hpp"
#include "util/parallel.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kLeastPhotos = 12;
constexpr int kReach = 6;  // pixels between edges of one mark
// Unaltered captures had up to 3 such pixels together, and 10 with half as many photos; logos of
// 10 % x 5 % 160 and more, dates of letters 3 % high 60 and more.
constexpr std::size_t kLeastEdges = 40;
constexpr double kLeastFacing = 0.08;  // of the edges, to each of four sides
constexpr double kMostArea = 0.05;     // of the photo
constexpr double kRim = 2;  // pixels around a mark, whose edges are the clearest of it alone
constexpr int kSteps = 8;   // places along a side

struct Edge {
  bool found = false;
  glm::vec2 step{0.0f};  // the typical one
};

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
  const double extent = extent_of(photos);
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

}  // namespace raysplats
