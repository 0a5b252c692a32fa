// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "raysplats/dataset.hpp"
#include "train/start/photo_set.hpp"

namespace raysplats {

/// What of photos their masks leave out.
struct MaskedOut {
  double points = 0;  ///< share of the places at which they show sparse points
  double pixels = 0;  ///< share of the pixels
  double edge = 0;    ///< share of the pixels along the photos' edges
  double agreed = 0;  ///< of what is kept, what other photos keep as well: 1 for one body's shape
  std::size_t seen = 0;    ///< places of sparse points that tell
  std::size_t photos = 0;  ///< that have a mask

  /// Whether the masks seem to mean the contrary, as people's that are white where people are: they
  /// leave out most sparse points, and the middle of the photos but not their edges, or all but
  /// patches that lie elsewhere in each photo. Masks that keep one body do not, however few points
  /// lie on it.
  bool inverted() const;
};

/// Compares the masks of those of `photos` that have one with the sparse points. `views`: the
/// numbers of the photos' views.
MaskedOut masked_out(const Dataset& dataset,
                     std::span<const SmallPhoto> photos,
                     std::span<const std::size_t> views,
                     std::uint64_t seed);

}  // namespace raysplats
