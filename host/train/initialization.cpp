// SPDX-License-Identifier: Apache-2.0
#include "train/initialization.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "io/model_file.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "scene/activation.hpp"
#include "scene/even_choice.hpp"
#include "scene/gaussian_selection.hpp"
#include "scene/kd_tree.hpp"
#include "shared/sh.h"
#include "train/photo_start.hpp"
#include "train/plane_sweep.hpp"
#include "train/point_check.hpp"
#include "train/point_cloud.hpp"
#include "train/pose_check.hpp"
#include "train/schedule.hpp"
#include "util/parallel.hpp"

namespace raysplats {
namespace {

// Fewer points leave most of the photos without a start.
constexpr std::size_t kFewPoints = 1000;
constexpr double kStartShare = 0.5;  // of the limit that points, or random places, may take
constexpr double kPhotoShare = 0.3;  // of the limit that a start from photos takes

// A part of the Gaussians that a run may have, one at least.
std::size_t share_of(std::size_t limit, double part) {
  return std::max<std::size_t>(1, static_cast<std::size_t>(part * static_cast<double>(limit)));
}

// The finite points within the box, each place once: equal neighbours would leave a point no size.
PointCloud distinct_points(const PointCloud& points, const std::optional<Bounds>& bounds) {
  const auto place = [&points](std::uint32_t i) {
    const float* p = points.positions.data() + 3 * static_cast<std::size_t>(i);
    return std::array<float, 3>{p[0], p[1], p[2]};
  };
  std::vector<std::uint32_t> order;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const auto [x, y, z] = place(static_cast<std::uint32_t>(i));
    if (!std::isfinite(x) || !std::isfinite(y) || !std::isfinite(z)) continue;
    if (!bounds || bounds->contains(x, y, z)) order.push_back(static_cast<std::uint32_t>(i));
  }
  std::stable_sort(order.begin(), order.end(),
                   [&](std::uint32_t a, std::uint32_t b) { return place(a) < place(b); });
  const auto end = std::unique(order.begin(), order.end(), [&](std::uint32_t a, std::uint32_t b) {
    return place(a) == place(b);
  });
  order.erase(end, order.end());
  std::sort(order.begin(), order.end());
  PointCloud out;
  for (const std::uint32_t i : order) append_point(points, i, out);
  return out;
}

// Where the cameras stand, three numbers each.
std::vector<double> places_of(std::span<const Camera> cameras) {
  std::vector<double> out;
  for (const Camera& camera : cameras) {
    const glm::dvec3 center = camera.center();
    if (!std::isfinite(center.x + center.y + center.z)) continue;  // which is near nothing
    out.insert(out.end(), {center.x, center.y, center.z});
  }
  return out;
}

// At most `limit` of the points, evenly spread over their order.
PointCloud subset(const PointCloud& points, std::size_t limit) {
  if (points.size() <= limit) return points;
  PointCloud out;
  for (const std::size_t i : even_choice(points.size(), limit)) append_point(points, i, out);
  return out;
}

// At most `limit` of the model's Gaussians, evenly spread over their order.
Gaussians subset(const Gaussians& model, std::size_t limit) {
  if (model.size() <= limit) return model;
  const std::vector<std::size_t> chosen = even_choice(model.size(), limit);
  return gathered(model, std::vector<std::uint32_t>(chosen.begin(), chosen.end()));
}

// Points that the photos tell of: of a body that is cut out, else of what a sweep finds in
// `depths`, or in those that it looks for: then nothing else has told that the poses are sound.
// `unsure`: as of swept_points().
PointCloud photo_points(const Dataset& dataset,
                        std::span<const Camera> cameras,
                        const Region& region,
                        const std::vector<SmallPhoto>& photos,
                        const std::optional<DepthRange>& depths,
                        std::size_t count,
                        double unsure,
                        std::uint64_t seed,
                        bool checks_poses) {
  const double guess = typical_depth(cameras, dataset.points);
  if (dataset.alpha_is_background) {
    if (checks_poses)
      check_poses(dataset, photos, probe_sweep(photos, depths_around(guess), seed).agreed, seed);
    PointCloud hull = carved_points(photos, region, count, seed);
    if (hull.size() > 0) return hull;
    spdlog::warn("the photos' alpha leaves no common body: the start fills the region instead");
    return scattered_points(photos, region, depths_around(guess), count, seed);
  }
  if (depths) return swept_points(photos, *depths, count, unsure, seed).points;
  const DepthRange found = swept_depths(photos, guess, seed);
  spdlog::debug(
      "the photos show what is {:.3g} to {:.3g} away, typically {:.3g} ({:.3g} by the "
      "cameras){}",
      found.nearest, found.farthest, found.typical, guess,
      found.open ? "; they leave depths open" : "");
  SweptPoints swept = swept_points(photos, found, count, unsure, seed);
  if (checks_poses) check_poses(dataset, photos, swept.agreed, seed);
  return std::move(swept.points);
}

// What of the points that photos tell of goes beside sparse ones, and where those that tell it
// look.
struct Beside {
  enum class Part { kNothing, kAll, kInTheirPlaces };
  Part part = Part::kNothing;
  std::optional<DepthRange> depths;
};

Beside photos_beside(const PointCloud& points,
                     const Dataset& dataset,
                     std::span<const Camera> cameras,
                     const PhotoSource& photos,
                     const TrainOptions& options) {
  constexpr double kMostlyBare = 0.31;    // of what photos show, in wide cells with no sparse point
  constexpr double kMostlyShown = 0.75;   // of the photos, where masks leave out the rest
  constexpr double kMostlyAgreed = 0.21;  // of what photos show, in one depth
  constexpr double kMostlyCovered = 0.72;  // of what agrees in one depth, with sparse points near
  if (options.init != "auto" || points.size() < kFewPoints) return {};
  const double bare = bare_share(points, photos(PhotoChoice::kSome));
  spdlog::debug("{:.1f} % of what photos show has no sparse points", 100 * bare);
  // Points on one thing alone say nothing of what is around it, unless that is not wanted.
  const bool part = bare > kMostlyBare && !options.bounds;
  const Beside by_points = {part ? Beside::Part::kAll : Beside::Part::kNothing, {}};
  if (!options.photo_points || dataset.alpha_is_background) return by_points;
  // Sparse points crowd where there is texture. What a sweep finds lies more evenly; where photos
  // are too far apart, or show little, it is wrong too often.
  const std::vector<SmallPhoto>& many = photos(PhotoChoice::kMany);
  // A body that masks leave is covered by its sparse points, and a sweep errs at its outline.
  const double shown = opaque_share(many);
  spdlog::debug("{:.1f} % of the photos count", 100 * shown);
  if (shown < kMostlyShown) return by_points;
  const double guess = typical_depth(cameras, dataset.points);
  const DepthRange depths = swept_depths(many, guess, options.seed);
  const SweptPoints probe = probe_sweep(many, depths, options.seed);
  spdlog::debug("{:.1f} % of what photos show agrees in one depth", 100 * probe.agreed);
  if (probe.agreed <= kMostlyAgreed) return {by_points.part, depths};
  // What has texture enough for a depth has sparse points too, unless they are of another part; a
  // sky has neither.
  const PointCloud told =
      distinct_points(probe.points, about_origin(options.bounds, dataset.origin));
  const std::size_t near = beside_points(told, points, many).size();
  const double covered =
      told.size() > 0 ? static_cast<double>(near) / static_cast<double>(told.size()) : 1;
  spdlog::debug("{:.1f} % of that has sparse points", 100 * covered);
  return {covered < kMostlyCovered ? Beside::Part::kAll : Beside::Part::kInTheirPlaces, depths};
}

std::string match_text(const PointMatch& match) {
  std::string out = fmt::format("{:.0f} % lie before a camera", 100 * match.seen);
  if (match.difference)
    out += fmt::format(", colours differ by {:.2f} of what chance does", *match.difference);
  if (match.scale != 1)
    out += fmt::format(", and by {:.2f} at {:.3g} times the size", match.scaled_difference,
                       match.scale);
  return out;
}

// The data set's points to start from: none where a start is free to do without and the photos show
// something else. `count`: of points that photos would give.
PointCloud start_points(const Dataset& dataset,
                        std::span<const Camera> cameras,
                        const PhotoSource& photos,
                        std::size_t count,
                        const TrainOptions& options) {
  constexpr double kMostlySeen = 0.5;  // of sparse points
  PointCloud reliable = reliable_points(dataset.points);
  if (options.init == "auto" && dataset.alpha_is_background) {
    // Points were often found before the photos were cut out.
    PointCloud hull = hull_points(reliable, photos(PhotoChoice::kAll));
    if (hull.size() < reliable.size()) {
      spdlog::info("{} of {} sparse points lie outside of what the cut-out photos show",
                   reliable.size() - hull.size(), reliable.size());
    }
    reliable = std::move(hull);
  }
  if (options.init == "auto" && reliable.size() > 0) {
    PointMatch match = match_points(reliable, cameras, photos(PhotoChoice::kSome));
    if (match.seen < kMostlySeen) {
      // Of a scan or a reconstruction of more than the photos show, those tell where they are.
      PointCloud seen = seen_points(reliable, cameras);
      const PointMatch of_seen = match_points(seen, cameras, photos(PhotoChoice::kSome));
      if (of_seen.difference && plausible(of_seen) && seen.size() >= std::max(kFewPoints, count)) {
        spdlog::info("{} of {} sparse points lie before a camera, and the start is of these",
                     seen.size(), reliable.size());
        reliable = std::move(seen);
        match = of_seen;
      }
    }
    spdlog::debug("sparse points: {}", match_text(match));
    if (!plausible(match)) {
      spdlog::warn(
          "the sparse points of {} are not where the photos show them ({}): they may be in other "
          "units or axes, or coloured by photos of another brightness, and the start takes points "
          "from the photos instead; --init colmap takes "
          "those of the data set",
          dataset.root.string(), match_text(match));
      return {};
    }
  }
  PointCloud points = distinct_points(reliable, about_origin(options.bounds, dataset.origin));
  if (!colorless(points)) return points;
  spdlog::info("the sparse points have no colours of their own: they start with the photos'");
  return colored_by_photos(std::move(points), photos(PhotoChoice::kSome));
}

// The model of the file that options.init names.
Gaussians given_model(const Dataset& dataset,
                      std::span<const Camera> cameras,
                      std::size_t limit,
                      const TrainOptions& options) {
  constexpr double kLeastSeen = 0.01;  // what photos of a model's scene see more of
  Gaussians model = with_sh_degree(read_model(options.init), options.sh_degree);
  const std::array<double, 3> origin = io::model_origin(options.init);
  for (std::size_t i = 0; i < model.means.size(); ++i) {
    model.means[i] = static_cast<float>(static_cast<double>(model.means[i]) +
                                        (origin[i % 3] - dataset.origin[i % 3]));
  }
  model = inside(model, about_origin(options.bounds, dataset.origin));
  if (model.size() > 0 && seen_share(model.means, cameras) < kLeastSeen) {
    spdlog::warn(
        "the photos see less than {:.0f} % of the Gaussians of {}: it is in other coordinates "
        "than the data set",
        100 * kLeastSeen, options.init);
  }
  if (model.size() > limit) {
    spdlog::warn(
        "{} has {} Gaussians, but this run may have {}: it starts from an even choice of them "
        "(--max-gaussians)",
        options.init, model.size(), limit);
  }
  return subset(model, limit);
}

// What sparse points give to a start.
struct SparseStart {
  PointCloud points;
  PointCloud sparse;  // all, where photos give more beside an even choice of them
  Beside beside;
  std::size_t count = 0;  // of points that the photos give
  bool enough = false;    // without those
};

// `count`: of points that photos give where sparse ones do not tell that fewer do.
SparseStart sparse_start(const Dataset& dataset,
                         std::span<const Camera> cameras,
                         const PhotoSource& photos,
                         std::size_t limit,
                         std::size_t count,
                         const TrainOptions& options) {
  constexpr std::size_t kMostBeside = 10000;  // points of photos: more take seconds to find
  SparseStart out;
  out.points = start_points(dataset, cameras, photos, count, options);
  out.beside = photos_beside(out.points, dataset, cameras, photos, options);
  const bool in_their_places = out.beside.part == Beside::Part::kInTheirPlaces;
  out.count = in_their_places ? std::min(count, kMostBeside) : count;
  const bool alone = out.beside.part == Beside::Part::kNothing;
  const std::size_t half = share_of(limit, kStartShare);
  const std::size_t others = half - std::min(out.count, half);
  const std::size_t most =
      alone ? half : std::max(share_of(limit, kStartShare - kPhotoShare), others);
  if (out.points.size() > most) {
    spdlog::info(
        "the start takes {} of {} sparse points, so that at most {} Gaussians have room to grow "
        "(--max-gaussians)",
        most, out.points.size(), limit);
  }
  // Sizes follow from the distances between the points that are left.
  if (options.init == "colmap" || (alone && out.points.size() > 0 &&
                                   out.points.size() >= std::min(kFewPoints, out.count / 2))) {
    out.points = subset(out.points, most);
    out.enough = true;
  } else if (!alone) {
    spdlog::info("{}: the start takes {} points from the photos as well",
                 out.beside.part == Beside::Part::kAll
                     ? "the sparse points lie on a part of what the photos show"
                     : "most of what the photos show tells its depth",
                 out.count);
    out.sparse = out.points;
    out.points = subset(out.points, most);
  } else if (out.points.size() > 0) {
    spdlog::info("{} sparse points are few: the start takes {} points from the photos as well",
                 out.points.size(), out.count);
  }
  return out;
}

}  // namespace

Gaussians gaussians_from_points(const PointCloud& points,
                                int sh_degree,
                                double opacity,
                                std::span<const Camera> cameras) {
  constexpr double kMinScale = 1e-4;  // of the scene extent
  constexpr double kMaxScale = 0.1;   // of the distance to the nearest camera
  constexpr double kRoom = 1.001;     // more than what rounding does
  PointCloud finite;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const float* p = points.positions.data() + 3 * i;
    if (!std::isfinite(p[0]) || !std::isfinite(p[1]) || !std::isfinite(p[2])) continue;
    append_point(points, i, finite);
  }
  Gaussians model;
  model.sh_degree = sh_degree;
  model.resize(finite.size());
  const std::vector<float> distances = neighbour_distances(finite.positions);
  const auto stride = 3 * static_cast<std::size_t>(sh_coefficients(sh_degree));
  const auto parameter = static_cast<float>(logit(opacity));
  const double least = kMinScale * scene_extent(cameras, finite);
  const std::vector<double> places = places_of(cameras);
  const KdTree<double> tree(places);
  in_parallel(model.size(), [&](std::size_t i) {
    const float* p = finite.positions.data() + 3 * i;
    // One that has no neighbours, or all of them in its place, may be as large as any.
    const double size = distances[i] > 0 ? static_cast<double>(distances[i])
                                         : std::numeric_limits<double>::infinity();
    // Cameras farther away do not bound it, so that most searches end early.
    const double within = kRoom * size / kMaxScale;
    const double most = kMaxScale * tree.nearest_distance({p[0], p[1], p[2]}, within);
    const double scale = std::max(std::min(size, most), least);
    for (std::size_t a = 0; a < 3; ++a) {
      model.means[3 * i + a] = p[a];
      model.log_scales[3 * i + a] = static_cast<float>(std::log(scale));
      model.sh[stride * i + a] = static_cast<float>((finite.colors[3 * i + a] - 0.5) / RS_SH0);
    }
    model.opacities[i] = parameter;
  });
  return model;
}

PointCloud reliable_points(const PointCloud& points) {
  constexpr std::uint32_t kReliableTrack = 3;
  constexpr float kReliableError = 2.0f;
  constexpr std::size_t kEnoughPoints = 2000;
  if (points.track_lengths.size() != points.size() || points.errors.size() != points.size())
    return points;
  PointCloud out;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (points.track_lengths[i] >= kReliableTrack && points.errors[i] <= kReliableError)
      append_point(points, i, out);
  }
  return out.size() >= kEnoughPoints ? out : points;
}

std::size_t fitted_limit(double pixels, std::int64_t iterations) {
  constexpr double kLimitFactor = 4.5;  // Gaussians per root of (pixels of a photo x iterations)
  constexpr std::size_t kLeastLimit = 2000;
  const double root = std::sqrt(pixels * static_cast<double>(iterations));
  return std::max(kLeastLimit, static_cast<std::size_t>(std::llround(kLimitFactor * root)));
}

std::optional<Bounds> about_origin(const std::optional<Bounds>& bounds,
                                   const std::array<double, 3>& origin) {
  if (!bounds) return std::nullopt;
  Bounds out = *bounds;
  for (std::size_t k = 0; k < 3; ++k) out.low[k] -= origin[k], out.high[k] -= origin[k];
  return out;
}

Gaussians inside(const Gaussians& model, const std::optional<Bounds>& bounds) {
  return bounds ? gathered(model, within(model, *bounds)) : model;
}

Gaussians initial_model(const Dataset& dataset,
                        std::span<const Camera> cameras,
                        const PhotoSource& photos,
                        std::size_t limit,
                        const TrainOptions& options,
                        bool checks_poses) {
  constexpr double kUnsureShare = 0.25;  // of points of photos everywhere: those in no clear depth
  constexpr double kUnsureBeside = 0.1;  // of those in places of sparse ones: more are only slower
  const bool has_points = dataset.points.size() > 0;
  if (options.init == "colmap" && !has_points) {
    throw UsageError(
        fmt::format("The data set {} has no sparse points to start from: use --init photos",
                    dataset.root.string()));
  }
  const bool by_name = options.init == "auto" || options.init == "colmap" ||
                       options.init == "random" || options.init == "photos";
  if (!by_name) return given_model(dataset, cameras, limit, options);
  const auto start = [&](const PointCloud& points) {
    return inside(gaussians_from_points(points, options.sh_degree, start_opacity(options), cameras),
                  about_origin(options.bounds, dataset.origin));
  };
  const std::size_t count =
      options.init_count > 0
          ? std::min(limit, static_cast<std::size_t>(options.init_count))
          : share_of(limit, clears_random_start(options) ? kStartShare : kPhotoShare);
  SparseStart begun;
  begun.count = count;
  if (has_points && (options.init == "auto" || options.init == "colmap"))
    begun = sparse_start(dataset, cameras, photos, limit, count, options);
  if (begun.enough) return start(begun.points);
  if (options.init_count > 0 && static_cast<std::size_t>(options.init_count) > limit) {
    spdlog::warn(
        "--init-count asks for {} Gaussians, but this run may have {}: it starts with no more "
        "(--max-gaussians)",
        options.init_count, limit);
  }
  const Region region = visible_region(cameras, scene_extent(cameras, dataset.points));
  if (options.init == "random") {
    return start(scattered_points(photos(PhotoChoice::kAll), region,
                                  depths_around(typical_depth(cameras, dataset.points)),
                                  begun.count, options.seed));
  }
  const std::vector<SmallPhoto>& told =
      photos(begun.beside.part == Beside::Part::kNothing ? PhotoChoice::kAll : PhotoChoice::kMany);
  const std::size_t room = std::min(begun.count, limit - std::min(limit, begun.points.size()));
  const bool in_their_places = begun.beside.part == Beside::Part::kInTheirPlaces;
  PointCloud seen =
      photo_points(dataset, cameras, region, told, begun.beside.depths, room,
                   in_their_places ? kUnsureBeside : kUnsureShare, options.seed, checks_poses);
  if (in_their_places) seen = beside_points(seen, begun.sparse, photos(PhotoChoice::kSome));
  for (std::size_t i = 0; i < seen.size(); ++i) append_point(seen, i, begun.points);
  return start(begun.points);
}

}  // namespace raysplats
