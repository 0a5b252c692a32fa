// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "raysplats/dataset.hpp"
#include "train/capture_geometry.hpp"
#include "train/start/depth_range.hpp"
#include "train/start/photo_set.hpp"

namespace raysplats {

/// Points to start from, told by the photos themselves. All are functions of the seed.

/// Points inside the visual hull of photos that are cut out by alpha: drawn evenly from `region`
/// until `count` of them are seen as background by no photo (Laurentini 1994; with one pixel to
/// spare). Their colour is the median of what the photos show there. Fewer than `count` when the
/// hull is a small part of the region.
PointCloud carved_points(std::span<const SmallPhoto> photos,
                         const Region& region,
                         std::size_t count,
                         std::uint64_t seed);

/// Those of a data set's points that lie in the visual hull of its cut-out photos, with room for
/// errors of poses and outlines: most of the photos that see a point's place show something there.
/// Points that none of `photos` sees are left out, so these have to be all.
PointCloud hull_points(const PointCloud& points, std::span<const SmallPhoto> photos);

/// A data set's points but for those that masks hide: at least four photos see a point's place, and
/// less than half of them count there. Masks of what moves hide a place in a few photos alone.
PointCloud counted_points(const PointCloud& points, std::span<const SmallPhoto> photos);

/// Points in random places, half of them evenly in `region`, half on the rays of random pixels of
/// the photos at any depth of the range, evenly by its logarithm. Their colours are the medians of
/// what some of the photos show there; grey where no photo looks.
PointCloud scattered_points(std::span<const SmallPhoto> photos,
                            const Region& region,
                            const DepthRange& depths,
                            std::size_t count,
                            std::uint64_t seed);

}  // namespace raysplats
