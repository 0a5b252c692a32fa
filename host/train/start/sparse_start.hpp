// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <cstddef>
#include <optional>
#include <span>

#include "raysplats/dataset.hpp"
#include "raysplats/train_options.hpp"
#include "train/start/depth_range.hpp"
#include "train/start/initialization.hpp"

namespace raysplats {

/// The share of the limit that points, or random places, may take.
constexpr double kStartShare = 0.5;
/// The share that a start from photos takes.
constexpr double kPhotoShare = 0.3;

/// A part of the Gaussians that a run may have, one at least.
inline std::size_t share_of(std::size_t limit, double part) {
  return std::max<std::size_t>(1, static_cast<std::size_t>(part * static_cast<double>(limit)));
}

/// What of the points that photos tell of goes beside sparse ones, and where those that tell it
/// look.
struct Beside {
  enum class Part { kNothing, kAll, kInTheirPlaces };
  Part part = Part::kNothing;
  std::optional<DepthRange> depths;
  double weight = 1;  ///< of the usual number of points
};

/// What sparse points give to a start, with points where there are none.
struct SparseStart {
  PointCloud points;
  PointCloud sparse;  ///< all of them, of which the start may take an even choice
  Beside beside;
  std::size_t count = 0;  ///< of points that the photos give
  bool enough = false;    ///< without those
};

/// What a start takes of the data set's points, at most its part of `limit` Gaussians, and whether
/// photos give more. `count`: of points that photos give where sparse ones do not tell that fewer
/// do. Says what it leaves out.
SparseStart sparse_start(const Dataset& dataset,
                         std::span<const Camera> cameras,
                         const PhotoSource& photos,
                         std::size_t limit,
                         std::size_t count,
                         const TrainOptions& options);

}  // namespace raysplats
