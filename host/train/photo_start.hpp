// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "raysplats/dataset.hpp"
#include "train/initialization.hpp"
#include "train/photo_set.hpp"

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

/// Those of a data set's points that lie in the visual hull of some of its cut-out photos, with
/// room for errors of poses and outlines: most of the photos that see a point's place show
/// something there. Points that no photo sees are left out.
PointCloud hull_points(const PointCloud& points, std::span<const SmallPhoto> photos);

/// Where a sweep looks, as distances from the cameras.
struct DepthRange {
  double nearest = 0;
  double typical = 0;  ///< of what most cameras look at
  double farthest = 0;
  bool open = false;  ///< the photos are too near to each other to tell any depth
};

/// The range of depths around what most cameras look at, `typical`.
DepthRange depths_around(double typical);

/// The range of depths around `guess`, unless many photos cannot tell what they show from the
/// infinitely far, as from a tripod: then it lies around what they do tell, or, where that is less
/// than half (`open`), beyond the depth up to which they would tell it. Where pixels agree much
/// nearer than that, as below a drone whose cameras have no common target, it lies around their
/// depth. `guess` is positive.
DepthRange swept_depths(std::span<const SmallPhoto> photos, double guess, std::uint64_t seed);

/// The share of random pixels at which neighbouring photos agree in one depth, of those that show
/// something: how much a sweep finds. 0 where nothing is shown.
double agreed_share(std::span<const SmallPhoto> photos,
                    const DepthRange& depths,
                    std::uint64_t seed);

/// Points on the rays of random pixels, at the depth where neighbouring photos agree best (a plane
/// sweep, Collins 1996, over single pixels with their surroundings). Of the pixels that no depth
/// explains clearly, the share `unsure` of `count` at most (all, where the range is open) get a
/// random depth, so that everything seen has something in front of it. Colours are the photos'.
PointCloud swept_points(std::span<const SmallPhoto> photos,
                        const DepthRange& depths,
                        std::size_t count,
                        double unsure,
                        std::uint64_t seed);

/// Points in random places, half of them evenly in `region`, half on the rays of random pixels of
/// the photos at any depth of the range, evenly by its logarithm. Their colours are the medians of
/// what some of the photos show there; grey where no photo looks.
PointCloud scattered_points(std::span<const SmallPhoto> photos,
                            const Region& region,
                            const DepthRange& depths,
                            std::size_t count,
                            std::uint64_t seed);

}  // namespace raysplats
