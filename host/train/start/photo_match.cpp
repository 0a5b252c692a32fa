// SPDX-License-Identifier: Apache-2.0
#include "train/start/photo_match.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <iterator>

#include "scene/camera/camera_model.hpp"
#include "scene/statistics.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kDepths = 128;    // that are looked at
constexpr double kMostMoved = 2.0;      // pixels in other photos between two of them
constexpr std::size_t kMostFiner = 32;  // times more of them, where that would be more

constexpr double kAgreement = 0.012;    // largest mean squared difference of what agrees
constexpr double kClear = 0.5;          // and the best depth's share of the median one
constexpr double kUnique = 0.7;         // and of the best one elsewhere: patterns repeat
constexpr double kRounding = 1e-5;      // a difference that 8 bits make of none
constexpr std::size_t kElsewhere = 8;   // steps from the best depth
constexpr double kSamePlace = 1.0;      // pixels in other photos: what is far moves by less a step
constexpr double kMostStretched = 8.0;  // pixels that one spans elsewhere: more is a picture's seam
constexpr double kSameDepth = 3.1;      // steps, from which another photo finds it, or kSamePlace
constexpr std::size_t kWitnesses = 2;   // photos that are asked for it

struct Patch {
  std::array<glm::dvec3, 9> colors;
};

// The pixels around a point, those to the right of each other `right` apart.
Patch patch_at(const SmallPhoto& photo,
               const glm::dvec2& point,
               const glm::dvec2& right = {1, 0},
               const glm::dvec2& down = {0, 1}) {
  Patch out;
  for (int k = 0; k < 9; ++k) {
    const int row = k / 3;
    const glm::dvec2 offset = (k % 3 - 1.0) * right + (row - 1.0) * down;
    out.colors[static_cast<std::size_t>(k)] = glm::dvec3(photo.at(point + offset));
  }
  return out;
}

glm::dvec3 point_on(const CameraRay& ray, double depth) {
  return ray.origin + depth * ray.direction;
}

// A pixel with those around it, as a photo shows them, and where other photos look for them.
class PatchRays {
 public:
  PatchRays(const SmallPhoto& photo, const PhotoPixel& pixel)
      : ray_(pixel.ray),
        right_(camera_ray(photo.camera, pixel.point.x + 1, pixel.point.y)),
        down_(camera_ray(photo.camera, pixel.point.x, pixel.point.y + 1)),
        patch_(patch_at(photo, pixel.point)) {}

  const Patch& patch() const { return patch_; }

  /// What the other photo shows of them if they are at that depth; nothing where it does not see
  /// it.
  std::optional<Patch> seen_by(const SmallPhoto& other, double depth) const {
    const auto point = other.sees(point_on(ray_, depth));
    if (!point || other.at(*point).w < 0.5) return std::nullopt;
    // Photos are turned against each other, as of a drone that flies back beside where it came.
    const auto right = project(other.camera, point_on(right_, depth));
    const auto down = project(other.camera, point_on(down_, depth));
    if (!right_.valid || !down_.valid || !right || !down) return patch_at(other, *point);
    const glm::dvec2 to_right = *right - *point, to_down = *down - *point;
    const bool torn =
        glm::length(to_right) > kMostStretched || glm::length(to_down) > kMostStretched;
    return torn ? patch_at(other, *point) : patch_at(other, *point, to_right, to_down);
  }

 private:
  CameraRay ray_, right_, down_;
  Patch patch_;
};

double difference(const Patch& a, const Patch& b) {
  double sum = 0;
  for (std::size_t k = 0; k < a.colors.size(); ++k) {
    const glm::dvec3 d = a.colors[k] - b.colors[k];
    sum += glm::dot(d, d);
  }
  return sum / static_cast<double>(3 * a.colors.size());
}

// Whether so many of the neighbours see something that what they show of it counts.
bool enough(std::size_t seen, std::span<const std::size_t> neighbours) {
  return seen > 1 && 2 * seen >= neighbours.size();
}

// How much the neighbours differ from the photo if what it shows is at that depth, or -1 where few
// see it.
double cost_at(std::span<const SmallPhoto> photos,
               std::span<const std::size_t> neighbours,
               const PatchRays& pixel,
               double depth) {
  std::array<double, kMostCompared> differences{};
  std::size_t count = 0;
  for (const std::size_t i : neighbours) {
    const auto seen = pixel.seen_by(photos[i], depth);
    if (seen) differences[count++] = difference(pixel.patch(), *seen);
  }
  if (!enough(count, neighbours)) return -1;
  // The better half: what hides the point from some photos does not speak against it.
  const std::size_t half = (count + 1) / 2 + (count > 3 ? 1 : 0);
  const auto begin = differences.begin();
  std::partial_sort(begin, begin + static_cast<std::ptrdiff_t>(half),
                    begin + static_cast<std::ptrdiff_t>(count));
  double sum = 0;
  for (std::size_t k = 0; k < half; ++k) sum += differences[k];
  return sum / static_cast<double>(half);
}

// Depths along a ray, evenly by the logarithm.
struct DepthSteps {
  DepthRange depths;
  std::size_t count = 0;
  double at(std::size_t step) const { return depths.at(step, count); }
  double log_step() const {
    return std::log(depths.farthest / depths.nearest) / static_cast<double>(count - 1);
  }
};

// How many pixels the neighbours would show between two points, in the middle of them.
double apart(std::span<const SmallPhoto> photos,
             std::span<const std::size_t> neighbours,
             const glm::dvec3& from,
             const glm::dvec3& to) {
  std::vector<double> found;
  for (const std::size_t i : neighbours) {
    const auto a = project(photos[i].camera, from), b = project(photos[i].camera, to);
    if (a && b) found.push_back(glm::distance(*a, *b));
  }
  return median(std::move(found));
}

// The depths at which a pixel is looked for. Through a long lens photos show together but a small
// part of the range, which a step of the usual length leaps over: there it is cut into shorter
// ones.
DepthSteps steps_of(std::span<const SmallPhoto> photos,
                    std::span<const std::size_t> neighbours,
                    const PhotoPixel& pixel,
                    const DepthRange& depths) {
  const DepthSteps usual{depths, kDepths};
  const double next = depths.typical * std::exp(usual.log_step());
  const double moved =
      apart(photos, neighbours, point_on(pixel.ray, depths.typical), point_on(pixel.ray, next));
  const double wanted = std::min(static_cast<double>(kMostFiner), std::ceil(moved / kMostMoved));
  const auto finer = static_cast<std::size_t>(wanted);
  if (finer <= 1) return usual;
  std::size_t first = kDepths, last = 0;
  for (std::size_t step = 0; step < kDepths; ++step) {
    const glm::dvec3 world = point_on(pixel.ray, usual.at(step));
    const auto seen = std::count_if(neighbours.begin(), neighbours.end(), [&](std::size_t i) {
      return photos[i].sees(world).has_value();
    });
    if (!enough(static_cast<std::size_t>(seen), neighbours)) continue;
    first = std::min(first, step);
    last = step;
  }
  if (first == kDepths) return usual;
  first -= first > 0 ? 1 : 0;
  last += last + 1 < kDepths ? 1 : 0;
  DepthSteps out{depths, finer * (last - first) + 1};
  out.depths.nearest = usual.at(first);
  out.depths.farthest = usual.at(last);
  return out;
}

// The costs of the steps that are not where the best one is, nor next to it.
std::vector<double> costs_elsewhere(std::span<const SmallPhoto> photos,
                                    std::span<const std::size_t> neighbours,
                                    const PhotoPixel& pixel,
                                    const DepthSteps& steps,
                                    const std::vector<double>& costs) {
  const std::size_t best = best_step(costs);
  const glm::dvec3 found = point_on(pixel.ray, steps.at(best));
  const auto same_place = [&](std::size_t step) {
    return apart(photos, neighbours, found, point_on(pixel.ray, steps.at(step))) < kSamePlace;
  };
  std::size_t begin = best - std::min(best, kElsewhere);
  std::size_t end = std::min(best + kElsewhere + 1, costs.size());
  while (begin > 0 && same_place(begin - 1)) --begin;
  while (end < costs.size() && same_place(end)) ++end;
  std::vector<double> out(costs.begin(), costs.begin() + static_cast<std::ptrdiff_t>(begin));
  out.insert(out.end(), costs.begin() + static_cast<std::ptrdiff_t>(end), costs.end());
  return out;
}

// A depth at which photos agree, and how far apart those are that they were asked for.
struct AgreedDepth {
  double depth = 0;
  double log_step = 0;
};

// The depth along the ray at which the neighbours agree with the photo, if there is one.
std::optional<AgreedDepth> agreed_depth(std::span<const SmallPhoto> photos,
                                        std::span<const std::size_t> neighbours,
                                        const PhotoPixel& pixel,
                                        const DepthRange& depths) {
  const DepthSteps steps = steps_of(photos, neighbours, pixel, depths);
  const std::vector<double> costs =
      match_costs(photos, neighbours, pixel, steps.depths, steps.count);
  if (!known_cost(costs, 0.5)) return std::nullopt;
  const std::size_t best = best_step(costs);
  const std::vector<double> elsewhere = costs_elsewhere(photos, neighbours, pixel, steps, costs);
  const std::optional<double> middle = known_cost(elsewhere, 0.5);
  if (!middle || !agrees(costs[best], *middle)) return std::nullopt;
  for (const double cost : elsewhere) {
    const bool as_good = costs[best] + kRounding > kUnique * (cost + kRounding);
    if (cost >= 0 && as_good) return std::nullopt;
  }
  return AgreedDepth{steps.at(best), steps.log_step()};
}

// Whether another photo that shows what the pixel does finds the depth too: photos agree by chance
// at many a wrong one, but seldom from both sides.
bool confirmed(std::span<const SmallPhoto> photos,
               std::span<const std::vector<std::size_t>> neighbours,
               const PhotoPixel& pixel,
               double depth,
               const DepthRange& depths) {
  const glm::dvec3 world = point_on(pixel.ray, depth);
  std::size_t asked = 0;
  for (const std::size_t i : neighbours[pixel.view]) {
    const auto point = photos[i].sees(world);
    if (!point) continue;
    const PhotoPixel other = pixel_at(photos, i, *point);
    if (!other.shows()) continue;
    const auto found = agreed_depth(photos, neighbours[i], other, depths);
    const double there = glm::distance(world, other.ray.origin);
    const auto tells_it = [&](const AgreedDepth& depth_there) {
      const double steps = std::abs(std::log(depth_there.depth / there)) / depth_there.log_step;
      return steps < kSameDepth || apart(photos, neighbours[i], world,
                                         point_on(other.ray, depth_there.depth)) < kSamePlace;
    };
    if (found && tells_it(*found)) return true;
    if (++asked == kWitnesses) return false;
  }
  return false;
}

}  // namespace

std::vector<double> match_costs(std::span<const SmallPhoto> photos,
                                std::span<const std::size_t> neighbours,
                                const PhotoPixel& pixel,
                                const DepthRange& depths,
                                std::size_t steps) {
  const PatchRays rays(photos[pixel.view], pixel);
  std::vector<double> costs(steps);
  for (std::size_t step = 0; step < steps; ++step) {
    costs[step] = cost_at(photos, neighbours, rays, depths.at(step, steps));
  }
  return costs;
}

std::size_t best_step(std::span<const double> costs) {
  std::size_t best = costs.size();
  for (std::size_t step = 0; step < costs.size(); ++step) {
    if (costs[step] >= 0 && (best == costs.size() || costs[step] < costs[best])) best = step;
  }
  return best;
}

std::optional<double> known_cost(std::span<const double> costs, double rank) {
  std::vector<double> known;
  std::copy_if(costs.begin(), costs.end(), std::back_inserter(known),
               [](double cost) { return cost >= 0; });
  if (known.empty() || known.size() < costs.size() / 4) return std::nullopt;
  const auto place =
      known.begin() + static_cast<std::ptrdiff_t>(rank * static_cast<double>(known.size()));
  std::nth_element(known.begin(), place, known.end());
  return *place;
}

bool agrees(double cost, double other) { return cost <= kAgreement && cost < kClear * other; }

std::optional<double> confirmed_depth(std::span<const SmallPhoto> photos,
                                      std::span<const std::vector<std::size_t>> neighbours,
                                      const PhotoPixel& pixel,
                                      const DepthRange& depths) {
  const auto found = agreed_depth(photos, neighbours[pixel.view], pixel, depths);
  const bool sure = found && confirmed(photos, neighbours, pixel, found->depth, depths);
  return sure ? std::optional(found->depth) : std::nullopt;
}

}  // namespace raysplats
