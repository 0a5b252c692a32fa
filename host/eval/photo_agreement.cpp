// SPDX-License-Identifier: Apache-2.0
#include "eval/photo_agreement.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>
#include <utility>

#include "scene/statistics.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kLeastPhotos = 12;
constexpr std::size_t kNeighbours = 6;
constexpr double kDegrees = 30;
constexpr double kDecibels = 8;
constexpr double kRelativeDecibels = 6;  // of the error relative to the photo's contrast
constexpr std::size_t kSomeBetter = 2;   // of the neighbours, of a photo that contradicts them
constexpr std::size_t kMostBetter = 4;   // of one that stands alone
constexpr double kFoldedShare = 0.1;
constexpr double kFoldedRest = 0.03;  // of those that do not stand alone
constexpr double kMostShare = 0.6;    // of photos that a model is better without
constexpr double kLinkDegrees = 45;   // to those that a photo follows to one side of a fold

// The median distance of photos from the middle of them.
double spread_of(std::span<const PlacedPhoto> photos) {
  glm::dvec3 middle;
  std::vector<double> values(photos.size());
  for (int k = 0; k < 3; ++k) {
    for (std::size_t i = 0; i < photos.size(); ++i) values[i] = photos[i].center[k];
    middle[k] = median(values);
  }
  for (std::size_t i = 0; i < photos.size(); ++i)
    values[i] = glm::distance(photos[i].center, middle);
  return median(std::move(values));
}

// Of each photo, how many of those beside it are far better.
std::vector<std::size_t> better_beside(std::span<const PlacedPhoto> photos) {
  const double spread = spread_of(photos);
  std::vector<std::size_t> out(photos.size());
  for (std::size_t i = 0; i < photos.size(); ++i) {
    const std::vector<std::size_t> beside = photos_beside(photos, i, kDegrees, kNeighbours, spread);
    const auto is_better = [&](std::size_t other) {
      const double nearer = photos[other].psnr - photos[i].psnr;
      return nearer >= kDecibels &&
             nearer + photos[other].contrast - photos[i].contrast >= kRelativeDecibels;
    };
    out[i] = static_cast<std::size_t>(std::count_if(beside.begin(), beside.end(), is_better));
  }
  return out;
}

std::vector<std::size_t> with_at_least(const std::vector<std::size_t>& counts, std::size_t least) {
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] >= least) out.push_back(i);
  }
  return out;
}

bool is_more(std::size_t count, double share, std::size_t of) {
  return static_cast<double>(count) > share * static_cast<double>(of);
}

// Whether photos contradict each other beside those that stand alone, which lie among better ones.
bool is_folded(std::span<const PlacedPhoto> photos, const std::vector<std::size_t>& better) {
  std::vector<PlacedPhoto> others;
  for (std::size_t i = 0; i < photos.size(); ++i) {
    if (better[i] < kMostBetter) others.push_back(photos[i]);
  }
  return !others.empty() && is_more(with_at_least(better_beside(others), kSomeBetter).size(),
                                    kFoldedRest, others.size());
}

// The value between the two classes of the most variance between them.
double between_classes(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  double all = 0;
  for (const double value : values) all += value;
  double most = -1, between = values.front(), lower = 0;
  for (std::size_t i = 1; i < values.size(); ++i) {
    lower += values[i - 1];
    const auto below = static_cast<double>(i), above = static_cast<double>(values.size() - i);
    const double apart = lower / below - (all - lower) / above;
    if (below * above * apart * apart <= most) continue;
    most = below * above * apart * apart;
    between = 0.5 * (values[i - 1] + values[i]);
  }
  return between;
}

// Marks the photos below `limit` that others below it join to marked ones.
void mark_side(std::span<const PlacedPhoto> photos, double limit, std::vector<bool>& marked) {
  std::vector<std::vector<std::size_t>> followers(photos.size());
  std::vector<std::size_t> open;
  for (std::size_t i = 0; i < photos.size(); ++i) {
    if (marked[i]) open.push_back(i);
    if (!(photos[i].psnr < limit)) continue;
    for (const std::size_t other : photos_beside(photos, i, kLinkDegrees, kNeighbours, HUGE_VAL))
      followers[other].push_back(i);
  }
  while (!open.empty()) {
    const std::size_t photo = open.back();
    open.pop_back();
    for (const std::size_t follower : followers[photo]) {
      if (marked[follower]) continue;
      marked[follower] = true;
      open.push_back(follower);
    }
  }
}

}  // namespace

Camera compared_camera(const Camera& full) {
  const int divisor = (std::max(full.width, full.height) + kComparedSide - 1) / kComparedSide;
  return divisor > 1 ? downscaled(full, divisor) : full;
}

std::vector<std::size_t> photos_beside(std::span<const PlacedPhoto> photos,
                                       std::size_t photo,
                                       double degrees,
                                       std::size_t count,
                                       double farthest) {
  const PlacedPhoto& one = photos[photo];
  const double least = std::cos(glm::radians(degrees));
  std::vector<std::pair<double, std::size_t>> others;  // distance, position
  for (std::size_t i = 0; i < photos.size(); ++i) {
    const PlacedPhoto& other = photos[i];
    if (i == photo) continue;
    if (one.direction && other.direction && glm::dot(*one.direction, *other.direction) <= least)
      continue;
    const double distance = glm::distance(one.center, other.center);
    if (distance <= farthest) others.emplace_back(distance, i);
  }
  const std::size_t found = std::min(others.size(), count);
  std::partial_sort(others.begin(), others.begin() + static_cast<std::ptrdiff_t>(found),
                    others.end());
  std::vector<std::size_t> out;
  out.reserve(found);
  for (std::size_t i = 0; i < found; ++i) out.push_back(others[i].second);
  return out;
}

std::vector<std::size_t> contradicted_photos(std::span<const PlacedPhoto> photos) {
  if (photos.size() < kLeastPhotos) return {};
  std::vector<std::size_t> out = with_at_least(better_beside(photos), kSomeBetter);
  if (!is_more(out.size(), kFoldedShare, photos.size())) out.clear();
  return out;
}

std::vector<std::size_t> photos_to_leave_out(std::span<const PlacedPhoto> photos) {
  if (photos.size() < kLeastPhotos) return {};
  const std::vector<std::size_t> better = better_beside(photos);
  std::vector<bool> marked(photos.size());
  for (const std::size_t photo : with_at_least(better, kMostBetter)) marked[photo] = true;
  const std::vector<std::size_t> some = with_at_least(better, kSomeBetter);
  if (is_more(some.size(), kFoldedShare, photos.size()) && is_folded(photos, better)) {
    std::vector<double> psnr;
    psnr.reserve(photos.size());
    for (const PlacedPhoto& photo : photos) psnr.push_back(photo.psnr);
    const double limit = between_classes(std::move(psnr));
    for (const std::size_t photo : some)
      if (photos[photo].psnr < limit) marked[photo] = true;
    mark_side(photos, limit, marked);
  }
  std::vector<std::size_t> out;
  for (std::size_t i = 0; i < marked.size(); ++i) {
    if (marked[i]) out.push_back(i);
  }
  if (is_more(out.size(), kMostShare, photos.size())) out.clear();
  return out;
}

}  // namespace raysplats
