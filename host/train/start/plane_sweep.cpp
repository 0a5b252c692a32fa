// SPDX-License-Identifier: Apache-2.0
#include "train/start/plane_sweep.hpp"

#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "raysplats/error.hpp"
#include "scene/camera/camera_model.hpp"
#include "scene/statistics.hpp"
#include "train/start/photo_match.hpp"
#include "train/start/photo_pixel.hpp"
#include "train/start/point_cloud.hpp"
#include "util/interrupt.hpp"
#include "util/parallel.hpp"
#include "util/rng.hpp"

namespace raysplats {
namespace {

// Random streams of one seed are told apart by a constant.
constexpr std::uint64_t kSweepStream = 0x7377656570;
constexpr std::uint64_t kProbeStream = 0x70726f6265;
constexpr std::size_t kTriesPerPoint = 4;
constexpr std::size_t kManyPoints = 50'000;  // that take long to find

constexpr double kLeastBase = 1e-3;    // between them, of the distance of what they show
constexpr double kColourWidths = 0.3;  // of a photo, that black and white in a channel are apart
constexpr double kNearest = 0.2, kFarthest = 10.0;  // depths of a sweep, times the typical one

// The search for the typical depth, from kNearest times the guess on.
constexpr std::size_t kProbes = 2000;      // pixels that are looked at
constexpr std::size_t kFewProbes = 40;     // that tell less are no reason to doubt the guess
constexpr std::size_t kProbeDepths = 112;  // steps to 1000 times the guess
constexpr double kProbeReach = 1000.0;
constexpr double kProbeTurn = 0.15;  // 1 - cosine between photos that are compared: 32 degrees
constexpr double kAsGood = 1.3;      // costs up to that multiple of the best agree as well
constexpr double kFloorCost = 1e-4;  // of photos' noise
constexpr double kWrongGuess = 3.0;  // factor
constexpr double kOpenShare = 0.5;   // of probes that see no end of the depths: most are open
constexpr double kForegroundShare = 0.05;  // of probes that agree about something before the open
constexpr double kBackgroundShare = 0.08;  // of those about something beyond a range
constexpr double kClearlyMore = 1.2;       // times as many pixels agree about another depth
constexpr int kRounds = 4;                 // of looking for other depths
constexpr double kMuchNearer = 0.65;       // than the typical one, as a share of it
constexpr double kMuchFarther = 2.0;
constexpr double kEnd = 1.25;  // times the nearest or farthest depth: an end of a range

// From where a photo looks where. The axis of a fisheye inverts its lens, so all are found once.
struct Pose {
  glm::dvec3 center, axis;
  bool all_around = false;  // a panorama: its axis is as good as any other direction
};

std::vector<Pose> poses_of(std::span<const SmallPhoto> photos) {
  std::vector<Pose> out;
  out.reserve(photos.size());
  for (const SmallPhoto& photo : photos) {
    const Camera& camera = photo.camera;
    const CameraRay ray = camera_ray(camera, 0.5 * camera.width, 0.5 * camera.height);
    out.push_back({camera.center(), ray.direction, camera.model == CameraModel::kEquirectangular});
  }
  return out;
}

// How differently two photos look, 1 - cosine.
double turn_between(const Pose& a, const Pose& b) {
  return a.all_around && b.all_around ? 0.0 : 1.0 - glm::dot(a.axis, b.axis);
}

// The kMostCompared photos with the lowest ranks.
std::vector<std::size_t> foremost(std::vector<std::pair<double, std::size_t>> ranked) {
  const std::size_t count = std::min(kMostCompared, ranked.size());
  std::partial_sort(ranked.begin(), ranked.begin() + static_cast<std::ptrdiff_t>(count),
                    ranked.end());
  std::vector<std::size_t> out(count);
  for (std::size_t i = 0; i < count; ++i) out[i] = ranked[i].second;
  return out;
}

// The photos that see most of what a photo sees from somewhere else: near centres, like axes.
std::vector<std::size_t> neighbours_of(std::span<const Pose> poses,
                                       std::size_t index,
                                       double distance) {
  std::vector<std::pair<double, std::size_t>> ranked;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const double base = glm::distance(poses[i].center, poses[index].center) / distance;
    // Two photos from the same place say nothing about depth.
    if (i == index || base < kLeastBase) continue;
    const double turn = turn_between(poses[i], poses[index]);
    ranked.emplace_back(std::abs(base - 0.15) + 2.0 * turn, i);
  }
  return foremost(std::move(ranked));
}

// A shell beyond that depth, and what may stand before it.
DepthRange open_range(double depth) { return {depth / kFarthest, 2.0 * depth, 3.0 * depth, true}; }

// How far away a pixel may be that has no clear depth.
double unclear_depth(const DepthRange& depths, double share) {
  const double most = depths.farthest / depths.typical;
  return depths.open ? depths.typical * std::pow(most, share)
                     : unknown_depth(depths.typical, share);
}

struct Sample {
  PhotoPixel pixel;
  double depth = 0;  // along its ray, at random where photos tell none
  bool agreed = false;
  glm::dvec3 color() const { return glm::dvec3(pixel.color); }
  glm::dvec3 position() const { return pixel.ray.origin + depth * pixel.ray.direction; }
};

Sample sweep_pixel(std::span<const SmallPhoto> photos,
                   const std::vector<std::vector<std::size_t>>& neighbours,
                   const DepthRange& depths,
                   std::uint64_t seed,
                   std::uint64_t stream,
                   std::size_t index) {
  CounterRng rng(seed, stream, 8 * index);
  const PhotoPixel pixel = random_pixel(photos, rng);
  const double share = rng.uniform();
  Sample out{pixel};
  if (!pixel.shows()) return out;
  const auto depth = confirmed_depth(photos, neighbours, pixel, depths);
  out.agreed = depth.has_value();
  out.depth = depth ? *depth : unclear_depth(depths, share);
  return out;
}

// What pixels tell, one after the other.
class Sweep {
 public:
  Sweep(std::span<const SmallPhoto> photos,
        const DepthRange& depths,
        std::uint64_t seed,
        std::uint64_t stream = kSweepStream)
      : photos_(photos), depths_(depths), seed_(seed), stream_(stream), neighbours_(photos.size()) {
    const std::vector<Pose> poses = poses_of(photos);
    in_parallel(photos.size(),
                [&](std::size_t i) { neighbours_[i] = neighbours_of(poses, i, depths.typical); });
  }

  void take(std::size_t count) {
    const std::size_t before = samples_.size();
    samples_.resize(before + count);
    in_parallel(count, [&](std::size_t i) {
      if (interrupt_requested()) {
        throw Error(ErrorCode::kInterrupted,
                    "Interrupted while the start was made: nothing is trained, and nothing saved");
      }
      samples_[before + i] = sweep_pixel(photos_, neighbours_, depths_, seed_, stream_, before + i);
    });
    for (std::size_t i = before; i < samples_.size(); ++i) {
      agreed_ += samples_[i].agreed ? 1 : 0;
      vague_ += !samples_[i].agreed && samples_[i].pixel.shows() ? 1 : 0;
    }
  }

  const std::vector<Sample>& samples() const { return samples_; }
  std::size_t agreed() const { return agreed_; }
  /// Samples that show something, in no clear depth.
  std::size_t vague() const { return vague_; }
  double agreed_share() const {
    const std::size_t shown = agreed_ + vague_;
    return shown > 0 ? static_cast<double>(agreed_) / static_cast<double>(shown) : 0.0;
  }

 private:
  std::span<const SmallPhoto> photos_;
  DepthRange depths_;
  std::uint64_t seed_, stream_;
  std::vector<std::vector<std::size_t>> neighbours_;
  std::vector<Sample> samples_;
  std::size_t agreed_ = 0, vague_ = 0;
};

// What agreed in a depth, as a photo sees it.
class AgreedPlaces {
 public:
  AgreedPlaces(const SmallPhoto& photo, std::span<const Sample> samples)
      : width_(photo.camera.width) {
    for (const Sample& sample : samples) {
      if (!sample.agreed) continue;
      const glm::dvec3 world = sample.position();
      const auto point = photo.sees(world);
      if (!point) continue;
      const double depth = glm::distance(world, photo.camera.center());
      places_.push_back({*point, sample.color(), depth});
    }
  }

  /// The depth of what is most like the photo's pixel in place and colour, if it sees any of it.
  std::optional<double> depth_near(const PhotoPixel& pixel) const {
    double least = std::numeric_limits<double>::infinity();
    std::optional<double> out;
    for (const Place& place : places_) {
      const glm::dvec2 apart = (pixel.point - place.point) / width_;
      const glm::dvec3 other = kColourWidths * (glm::dvec3(pixel.color) - place.color);
      const double squared = glm::dot(apart, apart) + glm::dot(other, other);
      if (squared < least) least = squared, out = place.depth;
    }
    return out;
  }

 private:
  struct Place {
    glm::dvec2 point;
    glm::dvec3 color;
    double depth;
  };
  double width_;
  std::vector<Place> places_;
};

// Photos that look the same way, those farthest apart first.
std::vector<std::size_t> distant_neighbours(std::span<const Pose> poses,
                                            std::size_t index,
                                            double distance) {
  std::vector<std::pair<double, std::size_t>> ranked;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    const double base = glm::distance(poses[i].center, poses[index].center);
    const bool apart = i != index && base >= kLeastBase * distance;
    if (apart && turn_between(poses[i], poses[index]) < kProbeTurn) ranked.emplace_back(-base, i);
  }
  return foremost(std::move(ranked));
}

// What a pixel tells of its depth.
struct Probe {
  double depth = 0;   // 0: nothing
  bool open = false;  // all greater depths agree as well
};

Probe probe_pixel(std::span<const SmallPhoto> photos,
                  const std::vector<std::vector<std::size_t>>& neighbours,
                  const DepthRange& depths,
                  std::uint64_t seed,
                  std::size_t index) {
  CounterRng rng(seed, kProbeStream, 8 * index);
  const PhotoPixel pixel = random_pixel(photos, rng);
  if (!pixel.shows()) return {};
  const std::vector<double> costs =
      match_costs(photos, neighbours[pixel.view], pixel, depths, kProbeDepths);
  // Depths at which photos cannot differ any more are as good as the best one, and may be most.
  const std::optional<double> wrong = known_cost(costs, 0.75);
  if (!wrong) return {};
  std::size_t best = best_step(costs);
  if (!agrees(costs[best], *wrong)) return {};
  const double enough = kAsGood * costs[best] + kFloorCost;
  std::size_t last = best;
  while (last + 1 < costs.size() && costs[last + 1] >= 0 && costs[last + 1] <= enough) ++last;
  const bool open = last + 1 == costs.size();
  while (open && best > 0 && costs[best - 1] >= 0 && costs[best - 1] <= enough) --best;
  // What agrees at every depth has no texture.
  if (open && (best == 0 || costs[best - 1] < 0)) return {};
  return {depths.at(best, kProbeDepths), open};
}

// Whether a depth is at an end of the range, where what lies beyond piles up.
bool at_end(double depth, const DepthRange& depths) {
  return depth < kEnd * depths.nearest || kEnd * depth > depths.farthest;
}

// How many of some pixels agree in a depth, and in which.
struct Agreement {
  std::size_t shown = 0;   // pixels that show something
  std::size_t inside = 0;  // not at_end()
  double depth = 0;        // the median; 0 of too few
};

Agreement agreement(std::span<const SmallPhoto> photos,
                    const DepthRange& depths,
                    std::uint64_t seed) {
  Sweep sweep(photos, depths, seed, kProbeStream);
  sweep.take(kProbes);
  Agreement out;
  std::vector<double> found;
  for (const Sample& sample : sweep.samples()) {
    if (!sample.agreed) continue;
    found.push_back(sample.depth);
    out.inside += at_end(sample.depth, depths) ? 0 : 1;
  }
  out.shown = sweep.agreed() + sweep.vague();
  if (found.size() >= kFewProbes) out.depth = median(std::move(found));
  return out;
}

bool clearly_more(const Agreement& a, const Agreement& b) {
  return static_cast<double>(a.inside) > kClearlyMore * static_cast<double>(b.inside);
}

struct Settled {
  DepthRange depths;
  Agreement agreement;
};

// The range about the depth at which pixels agree, where that is much nearer than the range's own,
// or much farther and more of them agree about it: photos to compare with are chosen by it, and
// those too far apart show little in common, those too near tell little of depth.
Settled settled(std::span<const SmallPhoto> photos, DepthRange depths, std::uint64_t seed) {
  Agreement here = agreement(photos, depths, seed);
  for (int round = 0; round < kRounds; ++round) {
    if (here.depth == 0) break;
    const bool nearer = here.depth < kMuchNearer * depths.typical;
    const bool farther = here.depth > kMuchFarther * depths.typical;
    if (!nearer && !farther) break;
    const DepthRange other = depths_around(here.depth);
    const Agreement there = agreement(photos, other, seed);
    if (farther && !clearly_more(there, here)) break;
    depths = other;
    here = there;
  }
  return {depths, here};
}

}  // namespace

DepthRange depths_around(double typical) {
  return {kNearest * typical, typical, kFarthest * typical};
}

DepthRange swept_depths(std::span<const SmallPhoto> photos, double guess, std::uint64_t seed) {
  const DepthRange around = depths_around(guess);
  const std::vector<Pose> poses = poses_of(photos);
  const bool one_place = std::all_of(poses.begin(), poses.end(), [&](const Pose& pose) {
    return glm::distance(pose.center, poses[0].center) < kLeastBase * guess;
  });
  if (photos.size() > 1 && one_place) return open_range(guess);
  std::vector<std::vector<std::size_t>> neighbours(photos.size());
  in_parallel(photos.size(),
              [&](std::size_t i) { neighbours[i] = distant_neighbours(poses, i, guess); });
  std::vector<Probe> probes(kProbes);
  in_parallel(kProbes, [&](std::size_t i) {
    probes[i] =
        probe_pixel(photos, neighbours, {kNearest * guess, guess, kProbeReach * guess}, seed, i);
  });
  std::vector<double> depths;
  std::size_t open = 0;
  for (const Probe& probe : probes) {
    if (probe.depth == 0) continue;
    depths.push_back(probe.depth);
    open += probe.open ? 1 : 0;
  }
  if (depths.size() < kFewProbes) return settled(photos, around, seed).depths;
  const std::array<double, 2> ranks{0.5, 0.75};
  const std::vector<double> found = quantiles(depths, ranks);
  const double open_share = static_cast<double>(open) / static_cast<double>(depths.size());
  if (open_share > kOpenShare) return open_range(found[1]);
  const double typical = found[0];
  const Settled near = settled(photos, around, seed);
  if (typical < kWrongGuess * near.depths.typical) return near.depths;
  // Photos far apart may agree by chance beyond what they show together, where neighbours do not.
  const DepthRange farther = depths_around(typical);
  const bool better = clearly_more(agreement(photos, farther, seed), near.agreement);
  return better ? settled(photos, farther, seed).depths : near.depths;
}

SweptPoints probe_sweep(std::span<const SmallPhoto> photos,
                        const DepthRange& depths,
                        std::uint64_t seed) {
  SweptPoints out;
  if (photos.empty()) return out;
  Sweep sweep(photos, depths, seed);
  sweep.take(kProbes);
  out.agreed = sweep.agreed_share();
  for (const Sample& sample : sweep.samples()) {
    if (sample.agreed) append_point(out.points, sample.position(), sample.color());
  }
  return out;
}

SweptPoints swept_points(std::span<const SmallPhoto> photos,
                         const DepthRange& depths,
                         std::size_t count,
                         double unsure,
                         std::uint64_t seed) {
  // Photos that tell no depth at all give a start as well, however small it is.
  const auto wanted = static_cast<std::size_t>(unsure * static_cast<double>(count));
  const std::size_t fog = std::min(count, std::max<std::size_t>(unsure > 0 ? 1 : 0, wanted));
  Sweep sweep(photos, depths, seed);
  // Until there are enough of both kinds; where depths are open, or few agree, not before all
  // tries.
  if (count >= kManyPoints) {
    spdlog::info("the start looks for {} points in {} photos, at up to {} pixels", count,
                 photos.size(), kTriesPerPoint * count);
  }
  const auto enough = [&] {
    return !depths.open && sweep.agreed() >= count - fog && sweep.vague() >= fog;
  };
  for (std::size_t tried = 0; tried < kTriesPerPoint && !enough(); ++tried) sweep.take(count);
  const std::size_t most_agreed = count - std::min(fog, sweep.vague());
  const std::size_t most_vague = depths.open ? count - std::min(sweep.agreed(), count - fog) : fog;
  std::vector<Sample> taken;
  // The taken samples that are as deep as what is around them, by photo.
  std::vector<std::vector<std::size_t>> as_deep(photos.size());
  std::size_t agreed = 0, vague = 0;
  for (const Sample& sample : sweep.samples()) {
    std::size_t& number = sample.agreed ? agreed : vague;
    if (number >= (sample.agreed ? most_agreed : most_vague) || !sample.pixel.shows()) continue;
    ++number;
    if (!sample.agreed && !depths.open && vague % 2 == 0)
      as_deep[sample.pixel.view].push_back(taken.size());
    taken.push_back(sample);
  }
  // One photo after the other, because many photos see most of what agreed.
  in_parallel(photos.size(), [&](std::size_t view) {
    if (as_deep[view].empty()) return;
    const AgreedPlaces places(photos[view], sweep.samples());
    for (const std::size_t i : as_deep[view])
      taken[i].depth = places.depth_near(taken[i].pixel).value_or(taken[i].depth);
  });
  SweptPoints out{sweep.agreed_share(), {}};
  for (const Sample& sample : taken) append_point(out.points, sample.position(), sample.color());
  return out;
}

namespace {

// `count` at most, where photos agree about a depth within the range.
PointCloud agreed_points(std::span<const SmallPhoto> photos,
                         const DepthRange& depths,
                         std::size_t count,
                         std::uint64_t seed) {
  PointCloud out;
  Sweep sweep(photos, depths, seed);
  for (std::size_t tried = 0; tried < kTriesPerPoint && sweep.agreed() < count; ++tried)
    sweep.take(count);
  for (const Sample& sample : sweep.samples()) {
    if (out.size() == count) break;
    if (sample.agreed && !at_end(sample.depth, depths))
      append_point(out, sample.position(), sample.color());
  }
  return out;
}

}  // namespace

PointCloud foreground_points(std::span<const SmallPhoto> photos,
                             double guess,
                             std::size_t count,
                             std::uint64_t seed) {
  const auto [depths, found] = settled(photos, depths_around(guess), seed);
  if (static_cast<double>(found.inside) <= kForegroundShare * static_cast<double>(found.shown))
    return {};
  return agreed_points(photos, depths, count, seed);
}

PointCloud background_points(std::span<const SmallPhoto> photos,
                             const DepthRange& depths,
                             std::size_t count,
                             std::uint64_t seed) {
  const DepthRange beyond = depths_around(depths.farthest);
  const Agreement far = agreement(photos, beyond, seed);
  if (static_cast<double>(far.inside) <= kBackgroundShare * static_cast<double>(far.shown))
    return {};
  const Agreement near = agreement(photos, depths, seed);
  const double share =
      static_cast<double>(far.inside) / static_cast<double>(far.inside + near.inside);
  return agreed_points(photos, beyond, static_cast<std::size_t>(share * static_cast<double>(count)),
                       seed);
}

SweptPoints searched_points(std::span<const SmallPhoto> photos,
                            double guess,
                            std::size_t count,
                            double unsure,
                            std::uint64_t seed) {
  const DepthRange depths = swept_depths(photos, guess, seed);
  spdlog::debug(
      "the photos show what is {:.3g} to {:.3g} away, typically {:.3g} ({:.3g} by the "
      "cameras){}",
      depths.nearest, depths.farthest, depths.typical, guess,
      depths.open ? "; they leave depths open" : "");
  const PointCloud beside = depths.open ? foreground_points(photos, guess, count / 2, seed)
                                        : background_points(photos, depths, count, seed);
  SweptPoints out = swept_points(photos, depths, count - beside.size(), unsure, seed);
  if (beside.size() > 0) {
    spdlog::debug("{} points of the start stand {}", beside.size(),
                  depths.open ? "before what is too far to tell its depth" : "beyond these depths");
    for (std::size_t i = 0; i < beside.size(); ++i) append_point(beside, i, out.points);
  }
  return out;
}

}  // namespace raysplats
