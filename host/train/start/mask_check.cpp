// SPDX-License-Identifier: Apache-2.0
#include "train/start/mask_check.hpp"

#include <algorithm>
#include <glm/vec3.hpp>
#include <numeric>

#include "scene/even_choice.hpp"
#include "train/capture_geometry.hpp"
#include "train/start/depth_range.hpp"
#include "train/start/photo_pixel.hpp"
#include "util/parallel.hpp"
#include "util/rng.hpp"

namespace raysplats {
namespace {

constexpr std::uint64_t kStream = 0x6d61736b73;
constexpr std::size_t kLookedAt = 2000;  // points of a photo
constexpr std::size_t kRays = 300;
constexpr std::size_t kTries = 50;  // for each of these
constexpr std::size_t kDepths = 96;
constexpr std::size_t kLeastOthers = 3;  // photos that see a place
// Of typical depths: wherever a body stands, its shape is found.
constexpr double kNearest = 0.02, kFarthest = 100;

constexpr std::size_t kFewPhotos = 6;  // fewer agree by chance
constexpr std::size_t kFewSeen = 200;
// Unaltered captures: 0.01 and 0.08 of the points and 0.95 and more agreed; their inverted masks
// 0.93 and more of the points, and people's that are inverted 0.2 to 0.3 agreed.
constexpr double kMostLost = 0.75;
constexpr double kPatches = 0.6;       // agreed less is of patches
constexpr double kSurePatches = 0.45;  // where no points tell
constexpr double kHalf = 0.5;          // of the edge, or of the pixels

bool counts(const SmallPhoto& photo, const glm::dvec2& place) {
  return photo.known(place) && photo.at(place).w >= 0.5;
}

// Whether the photo shows something at the place or next to it.
bool counts_near(const SmallPhoto& photo, const glm::dvec2& place) {
  for (const double dy : {-1.0, 0.0, 1.0}) {
    for (const double dx : {-1.0, 0.0, 1.0}) {
      if (counts(photo, place + glm::dvec2(dx, dy))) return true;
    }
  }
  return false;
}

// Numbers of the sparse points that a photo may show, at most so many.
std::vector<std::size_t> points_before(const Dataset& dataset, std::size_t view) {
  const std::vector<std::uint32_t>& shown = dataset.views[view].points;
  const std::size_t count = shown.empty() ? dataset.points.size() : shown.size();
  std::vector<std::size_t> out = even_choice(count, kLookedAt);
  if (!shown.empty()) {
    for (std::size_t& i : out) i = shown[i];
  }
  return out;
}

// A part of what was counted.
struct Share {
  std::size_t part = 0, whole = 0;
  void add(bool counted) { ++whole, part += counted ? 1 : 0; }
  double value() const {
    return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : 0.0;
  }
};

// Of the places at which a photo shows sparse points, those that are left out.
void count_points(const Dataset& dataset,
                  std::size_t view,
                  const SmallPhoto& photo,
                  Share& left_out) {
  for (const std::size_t i : points_before(dataset, view)) {
    const float* p = &dataset.points.positions[3 * i];
    if (const auto place = photo.sees({p[0], p[1], p[2]})) left_out.add(!counts(photo, *place));
  }
}

void count_pixels(const SmallPhoto& photo, Share& left_out, Share& left_out_of_edge) {
  const int width = photo.camera.width, height = photo.camera.height;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const bool out = !counts(photo, {x + 0.5, y + 0.5});
      left_out.add(out);
      if (x == 0 || y == 0 || x == width - 1 || y == height - 1) left_out_of_edge.add(out);
    }
  }
}

// The largest share of the other photos that see a place on the pixel's ray and keep it.
double best_agreement(std::span<const SmallPhoto> photos,
                      const PhotoPixel& pixel,
                      const DepthRange& depths) {
  double best = 0;
  for (std::size_t step = 0; step < kDepths; ++step) {
    const glm::dvec3 world = pixel.ray.origin + depths.at(step, kDepths) * pixel.ray.direction;
    std::size_t seen = 0, kept = 0;
    for (std::size_t i = 0; i < photos.size(); ++i) {
      if (i == pixel.view) continue;
      const auto place = photos[i].sees(world);
      if (!place) continue;
      ++seen;
      kept += counts_near(photos[i], *place) ? 1 : 0;
    }
    if (seen < kLeastOthers) continue;
    best = std::max(best, static_cast<double>(kept) / static_cast<double>(seen));
  }
  return best;
}

double agreement(std::span<const SmallPhoto> photos, const DepthRange& depths, std::uint64_t seed) {
  CounterRng rng(seed, kStream);
  std::vector<PhotoPixel> pixels;
  for (std::size_t tried = 0; tried < kTries * kRays && pixels.size() < kRays; ++tried) {
    const PhotoPixel pixel = random_pixel(photos, rng);
    if (pixel.shows() && photos[pixel.view].known(pixel.point)) pixels.push_back(pixel);
  }
  std::vector<double> best(pixels.size());
  in_parallel(pixels.size(),
              [&](std::size_t i) { best[i] = best_agreement(photos, pixels[i], depths); });
  const double sum = std::accumulate(best.begin(), best.end(), 0.0);
  return best.empty() ? 0 : sum / static_cast<double>(best.size());
}

}  // namespace

MaskedOut masked_out(const Dataset& dataset,
                     std::span<const SmallPhoto> all,
                     std::span<const std::size_t> views,
                     std::uint64_t seed) {
  std::vector<SmallPhoto> photos;
  std::vector<Camera> cameras;
  Share points, pixels, edge;
  for (std::size_t i = 0; i < all.size(); ++i) {
    if (dataset.views[views[i]].mask_path.empty()) continue;
    photos.push_back(all[i]);
    cameras.push_back(all[i].camera);
    count_points(dataset, views[i], all[i], points);
    count_pixels(all[i], pixels, edge);
  }
  if (photos.empty()) return {};
  const double typical = typical_depth(cameras, dataset.points);
  const DepthRange depths{kNearest * typical, typical, kFarthest * typical, false};
  return {points.value(), pixels.value(), edge.value(), agreement(photos, depths, seed),
          points.whole,   photos.size()};
}

bool MaskedOut::inverted() const {
  if (photos < kFewPhotos) return false;
  const bool islands = edge >= kHalf;  // else what is left out lies in the photos' middle
  if (seen < kFewSeen) return islands && pixels >= kHalf && agreed < kSurePatches;
  return points >= kMostLost && (islands ? agreed < kPatches : points > pixels);
}

}  // namespace raysplats
