// SPDX-License-Identifier: Apache-2.0
#include "train/start/initialization.hpp"

#include <fmt/format.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <utility>

#include "io/model/model_file.hpp"
#include "raysplats/error.hpp"
#include "raysplats/io.hpp"
#include "scene/even_choice.hpp"
#include "scene/gaussians/activation.hpp"
#include "scene/gaussians/gaussian_selection.hpp"
#include "scene/kd_tree.hpp"
#include "shared/sh.h"
#include "train/schedule.hpp"
#include "train/start/photo_start.hpp"
#include "train/start/plane_sweep.hpp"
#include "train/start/point_check.hpp"
#include "train/start/point_cloud.hpp"
#include "train/start/point_cover.hpp"
#include "train/start/pose_check.hpp"
#include "train/start/sparse_start.hpp"
#include "util/file_kind.hpp"
#include "util/parallel.hpp"

namespace raysplats {
namespace {

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
  SweptPoints swept = searched_points(photos, guess, count, unsure, seed);
  if (checks_poses) check_poses(dataset, photos, swept.agreed, seed);
  return std::move(swept.points);
}

// The model of the file that options.init names.
Gaussians given_model(const Dataset& dataset,
                      std::span<const Camera> cameras,
                      std::size_t limit,
                      const TrainOptions& options) {
  constexpr double kLeastSeen = 0.01;  // what photos of a model's scene see more of
  if (!is_there(options.init)) {
    throw DataError(fmt::format(
        "The start '{}' is neither a file that exists nor one of auto, colmap, photos and random",
        options.init));
  }
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
