// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "raysplats/camera.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/gaussians.hpp"
#include "raysplats/train_options.hpp"
#include "train/capture_geometry.hpp"
#include "train/start/photo_set.hpp"

namespace raysplats {

/// Isotropic Gaussians at the points: the scale is the mean distance of the three nearest
/// neighbours, as in 3DGS, at least 1e-4 of scene_extent() and at most 0.1 of the distance to
/// the nearest camera (what stands alone far away may be large, before a camera it may not), which
/// a point takes that no neighbour is apart from; band 0 holds the colours. Points that are not
/// finite are left out.
Gaussians gaussians_from_points(const PointCloud& points,
                                int sh_degree,
                                double opacity,
                                std::span<const Camera> cameras);

/// The points that can be relied on: seen by at least three photos with an error of at most 2
/// pixels, unless fewer than 2000 are left; all of them when nothing is known about them.
PointCloud reliable_points(const PointCloud& points);

/// What Gaussians a run may have when max-gaussians leaves it open: grows with the pixels of a
/// photo that show something and with the root of the iterations, because each Gaussian needs steps
/// and pixels to learn from.
std::size_t fitted_limit(double pixels, std::int64_t iterations);

/// A box of the world as a model counts positions, from `origin` (Dataset::origin).
std::optional<Bounds> about_origin(const std::optional<Bounds>& bounds,
                                   const std::array<double, 3>& origin);

/// The Gaussians whose mean lies in the box; all of them without one.
Gaussians inside(const Gaussians& model, const std::optional<Bounds>& bounds);

/// Which training views: all, or at most a hundred or two dozen that are spread evenly over them.
enum class PhotoChoice { kAll, kMany, kSome };

/// Photos of the training views, loaded when they are first asked for.
using PhotoSource = std::function<const std::vector<SmallPhoto>&(PhotoChoice)>;

/// The model a run starts from, by options.init, at most `limit` Gaussians (an even subset of more;
/// of points and photos at most half of it, so that there is room to grow; all of it, with a
/// warning, where options.init_count asks for more), all within options.bounds. Sparse points that
/// photos contradict (plausible()) are left out by `auto`, with a warning. `checks_poses`: whether
/// poses that no points vouch for are looked at (check_poses()). Throws UsageError
/// when the data set has no points and `colmap` is asked for, DataError for a bad PLY.
Gaussians initial_model(const Dataset& dataset,
                        std::span<const Camera> cameras,
                        const PhotoSource& photos,
                        std::size_t limit,
                        const TrainOptions& options,
                        bool checks_poses = true);

}  // namespace raysplats
