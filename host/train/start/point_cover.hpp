// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "raysplats/dataset.hpp"
#include "train/start/photo_set.hpp"

namespace raysplats {

/// The share of what the photos show that lies in wide places without a point: square cells of a
/// seventh of a photo's longer side, but for those that are transparent, masked out or without
/// texture, as on white walls, where no point can be found. 0 where nothing is shown.
double bare_share(const PointCloud& points, std::span<const SmallPhoto> photos);

/// Points on the rays of random pixels in such places, those without texture as well, as of skies
/// and white walls: however far away (unknown_depth() of `typical`), in the photos' colours.
/// `looks`: pixels that are drawn from all places.
PointCloud uncovered_points(const PointCloud& points,
                            std::span<const SmallPhoto> photos,
                            double typical,
                            std::size_t looks,
                            std::uint64_t seed);

/// The points of `found` that lie near others: in cells of 10 pixels a side that show some of
/// `points`, in at least half of the photos that see them. Without their tracks and errors.
PointCloud beside_points(const PointCloud& found,
                         const PointCloud& points,
                         std::span<const SmallPhoto> photos);

}  // namespace raysplats
