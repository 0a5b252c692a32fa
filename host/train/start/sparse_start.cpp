// SPDX-License-Identifier: Apache-2.0
#include "train/start/sparse_start.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "scene/even_choice.hpp"
#include "train/start/photo_start.hpp"
#include "train/start/plane_sweep.hpp"
#include "train/start/point_check.hpp"
#include "train/start/point_cloud.hpp"
#include "train/start/point_cover.hpp"

namespace raysplats {
namespace {

// Fewer points leave most of the photos without a start.
constexpr std::size_t kFewPoints = 1000;

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

// At most `limit` of the points, evenly spread over their order.
PointCloud subset(const PointCloud& points, std::size_t limit) {
  if (points.size() <= limit) return points;
  PointCloud out;
  for (const std::size_t i : even_choice(points.size(), limit)) append_point(points, i, out);
  return out;
}

Beside photos_beside(const PointCloud& points,
                     const Dataset& dataset,
                     std::span<const Camera> cameras,
                     const PhotoSource& photos,
                     const TrainOptions& options) {
  constexpr double kMostlyBare = 0.31;   // of what photos show, in wide cells with no sparse point
  constexpr double kMostlyShown = 0.75;  // of the photos, where masks leave out the rest
  // Of what photos show, in one depth: below this much it is wrong too often, as in foliage and on
  // streets, from that much on it is mostly right.
  constexpr double kMostlyAgreed = 0.21, kSurelyAgreed = 0.30;
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
  if (covered < kMostlyCovered) return {Beside::Part::kAll, depths};
  const double sure = (probe.agreed - kMostlyAgreed) / (kSurelyAgreed - kMostlyAgreed);
  return {Beside::Part::kInTheirPlaces, depths, std::min(sure, 1.0)};
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

// Whether masks or areas let a part of the photos not count.
bool leaves_out_parts(const Dataset& dataset) {
  return std::any_of(dataset.views.begin(), dataset.views.end(), [](const View& view) {
    return !view.mask_path.empty() || !view.ignored.empty();
  });
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
  } else if (options.init == "auto" && leaves_out_parts(dataset)) {
    // Few photos tell what becomes of a Gaussian that masks hide: it would stay much as it began.
    PointCloud counted = counted_points(reliable, photos(PhotoChoice::kMany));
    if (counted.size() < reliable.size()) {
      spdlog::info("{} of {} sparse points lie where few photos count",
                   reliable.size() - counted.size(), reliable.size());
    }
    reliable = std::move(counted);
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

// Adds points where no sparse ones are, as in skies and on white walls, a fifth as many as there
// are if these were nowhere. A body that is cut out, or within bounds, has nothing around it.
void add_uncovered(const PointCloud& sparse,
                   const Dataset& dataset,
                   std::span<const Camera> cameras,
                   const PhotoSource& photos,
                   const TrainOptions& options,
                   PointCloud& points) {
  constexpr double kShare = 0.2;
  const bool wanted = options.init == "auto" && options.uncovered_points;
  if (!wanted || dataset.alpha_is_background || options.bounds) return;
  const auto looks = static_cast<std::size_t>(kShare * static_cast<double>(points.size()));
  const PointCloud found =
      uncovered_points(sparse, photos(PhotoChoice::kSome), typical_depth(cameras, dataset.points),
                       looks, options.seed);
  spdlog::debug("{} points of the start stand where there are no sparse ones", found.size());
  for (std::size_t i = 0; i < found.size(); ++i) append_point(found, i, points);
}

}  // namespace

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
  out.count = in_their_places ? share_of(std::min(count, kMostBeside), out.beside.weight) : count;
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
  out.sparse = out.points;
  // Sizes follow from the distances between the points that are left.
  if (options.init == "colmap" || (alone && out.points.size() > 0 &&
                                   out.points.size() >= std::min(kFewPoints, out.count / 2))) {
    out.points = subset(out.sparse, most);
    out.enough = true;
  } else if (!alone) {
    spdlog::info("{}: the start takes {} points from the photos as well",
                 out.beside.part == Beside::Part::kAll
                     ? "the sparse points lie on a part of what the photos show"
                     : "most of what the photos show tells its depth",
                 out.count);
    out.points = subset(out.sparse, most);
  } else if (out.points.size() > 0) {
    spdlog::info("{} sparse points are few: the start takes {} points from the photos as well",
                 out.points.size(), out.count);
  }
  // Of the points that photos give everywhere some stand there already.
  if (out.enough || in_their_places)
    add_uncovered(out.sparse, dataset, cameras, photos, options, out.points);
  return out;
}

}  // namespace raysplats
