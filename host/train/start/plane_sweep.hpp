// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "raysplats/dataset.hpp"
#include "train/start/depth_range.hpp"
#include "train/start/photo_set.hpp"

namespace raysplats {

/// The range of depths around what most cameras look at, `typical`.
DepthRange depths_around(double typical);

/// The range of depths around `guess`, unless photos tell of another. Where most pixels cannot tell
/// what they show from the infinitely far, as from a tripod (`open`), it begins beyond the depth up
/// to which they would. Where pixels agree much nearer than the guess, as below a drone whose
/// cameras have no common target, it lies around their depth; likewise where clearly more of them
/// agree about a farther one, as from cameras turned at arm's length. `guess` is positive.
DepthRange swept_depths(std::span<const SmallPhoto> photos, double guess, std::uint64_t seed);

/// What a sweep finds.
struct SweptPoints {
  /// The share of the pixels, of those that show something, at which neighbouring photos agree in
  /// one depth, which one of them finds as well. 0 where nothing is shown.
  double agreed = 0;
  PointCloud points;
};

/// A sweep over a few random pixels, and the points where photos agree.
SweptPoints probe_sweep(std::span<const SmallPhoto> photos,
                        const DepthRange& depths,
                        std::uint64_t seed);

/// Points on the rays of random pixels, at the depth where neighbouring photos agree best (a plane
/// sweep, Collins 1996, over single pixels with their surroundings, which photos are looked up for
/// turned and scaled as they see them) and which one of two of these photos, swept from its side,
/// finds as well (the check of consistency of multi-view stereo). Of the pixels that no depth
/// explains clearly, the share `unsure` of `count` at most (one at least unless it is 0; all, where
/// the range is open) are taken as well, so that everything seen has something in front of it: one
/// half at random depths, the other as deep as what agreed and is most like them in place and
/// colour, unless the range is open. Colours are the photos'. Throws Error (kInterrupted) when a
/// signal is marked (InterruptGuard), as all sweeps do.
SweptPoints swept_points(std::span<const SmallPhoto> photos,
                         const DepthRange& depths,
                         std::size_t count,
                         double unsure,
                         std::uint64_t seed);

/// Points, `count` at most, of what stands before an open range, as a terrace before far mountains:
/// what agrees about a depth around those that photos agree about nearest to `guess`. None where
/// next to no pixels agree about any.
PointCloud foreground_points(std::span<const SmallPhoto> photos,
                             double guess,
                             std::size_t count,
                             std::uint64_t seed);

/// Points of what lies beyond the depths of a sweep, as mountains behind a terrace: what agrees
/// about a depth around `depths.farthest`, in photos farther apart. As many of `count` as pixels
/// agree there, of those that agree there or in `depths`. None where 8 % of the pixels or fewer do.
PointCloud background_points(std::span<const SmallPhoto> photos,
                             const DepthRange& depths,
                             std::size_t count,
                             std::uint64_t seed);

/// As swept_points(), in the depths that swept_depths() finds. Where these are open, what stands
/// before them is swept as well, for up to half of `count`; else what lies beyond them.
SweptPoints searched_points(std::span<const SmallPhoto> photos,
                            double guess,
                            std::size_t count,
                            double unsure,
                            std::uint64_t seed);

}  // namespace raysplats
