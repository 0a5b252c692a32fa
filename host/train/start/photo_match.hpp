// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "train/start/depth_range.hpp"
#include "train/start/photo_pixel.hpp"
#include "train/start/photo_set.hpp"

namespace raysplats {

/// Photos that one is compared with, at most.
inline constexpr std::size_t kMostCompared = 5;

/// How much neighbouring photos differ from what is at the pixel and around it, if that lies at
/// each of `steps` depths of the range, evenly by the logarithm: mean squared differences of
/// colours, over the better half of the photos that see it; below 0 where fewer than half of them
/// do. Each photo is looked up where, and turned and scaled as, it would show the pixel's
/// surroundings. `neighbours`: indices of at most kMostCompared photos.
std::vector<double> match_costs(std::span<const SmallPhoto> photos,
                                std::span<const std::size_t> neighbours,
                                const PhotoPixel& pixel,
                                const DepthRange& depths,
                                std::size_t steps);

/// The step of the least known cost; `costs` has a known one.
std::size_t best_step(std::span<const double> costs);

/// The known cost that the share `rank` of the known ones lies below; nothing when less than a
/// quarter is known.
std::optional<double> known_cost(std::span<const double> costs, double rank);

/// Whether a cost is so small, and so much smaller than `other`, that photos agree there.
bool agrees(double cost, double other);

/// The depth along the pixel's ray at which neighbouring photos agree with it, and which one of two
/// of these finds as well from its side (the check of consistency of multi-view stereo); nothing
/// where there is none, or where another depth, far from it, explains the pixel as well. Depths are
/// so near to each other that, about the typical one, the pixel moves by at most two pixels in the
/// middle of those photos.
/// `neighbours`: for every photo those that it is compared with.
std::optional<double> confirmed_depth(std::span<const SmallPhoto> photos,
                                      std::span<const std::vector<std::size_t>> neighbours,
                                      const PhotoPixel& pixel,
                                      const DepthRange& depths);

}  // namespace raysplats
