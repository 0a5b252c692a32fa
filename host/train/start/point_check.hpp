// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <vector>

#include "raysplats/camera.hpp"
#include "raysplats/dataset.hpp"
#include "train/start/photo_set.hpp"

namespace raysplats {

/// How sparse points and photos go together.
struct PointMatch {
  double seen = 0;  ///< share of the points that some camera sees
  /// Difference between the points' colours and the photos' where the points show and no other lies
  /// clearly before them, over that of colours of other points: far below 1 where points lie on
  /// what the photos show. Nothing where that cannot be told: points of one colour, or too few that
  /// the photos see.
  std::optional<double> difference;
  /// Factor about the world's origin, and the difference of points so moved, where that is least;
  /// 1 and `difference` where they are best as they are.
  double scale = 1;
  double scaled_difference = 0;
};

/// The share of the positions (x, y, z each) that some camera sees, of an even choice of them; 0 of
/// none.
double seen_share(const std::vector<float>& positions, std::span<const Camera> cameras);

/// Compares an even choice of the points with the cameras, and with photos of some of them.
PointMatch match_points(const PointCloud& points,
                        std::span<const Camera> cameras,
                        std::span<const SmallPhoto> photos);

/// The points that some camera sees, without their tracks and errors.
PointCloud seen_points(const PointCloud& points, std::span<const Camera> cameras);

/// Whether all points have one colour, as those of programs that find none (black, grey, white).
bool colorless(const PointCloud& points);

/// The points in the colours in which photos show them: of each the median, grey where none does.
PointCloud colored_by_photos(PointCloud points, std::span<const SmallPhoto> photos);

/// Whether points can be where they are: not when they are in other units or axes than the cameras.
bool plausible(const PointMatch& match);

}  // namespace raysplats
