// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "raysplats/camera.hpp"
#include "raysplats/dataset.hpp"
#include "train/crowded_places.hpp"
#include "train/start/mask_check.hpp"
#include "train/start/photo_set.hpp"

namespace raysplats {

/// What is wrong with a capture that a run can tell before its first step: a sentence without its
/// capital and full stop, "" where nothing is.

/// Cameras far from all others; as a rule their poses are wrong.
std::string strays_warning(std::span<const Camera> cameras);

/// Held-out photos that look where no training photo does.
std::string direction_warning(const Dataset& dataset,
                              std::span<const Camera> held_out,
                              std::span<const Camera> trained);

/// Photos without colour among others; `read`: of `all` photos of the run.
std::string grey_warning(std::span<const SmallPhoto> read, std::size_t all);

/// Masks that leave out what others would keep.
std::string masks_warning(const Dataset& dataset, const MaskedOut& masked);

/// Photos of the size at which marks are looked for, however small the run has them.
std::vector<SmallPhoto> photos_for_marks(const Dataset& dataset,
                                         std::span<const std::size_t> views,
                                         const ReadingProgress& progress);

/// What stands at the same pixels of all photos: a turntable's ground, a logo, a date. `views`: of
/// which the photos are (photos_for_marks()).
std::string marks_warning(const Dataset& dataset,
                          std::span<const SmallPhoto> read,
                          std::span<const std::size_t> views);

/// Places with far more photos than others; `crowded` by positions in `trained`.
std::string crowds_warning(const CrowdedPlaces& crowded,
                           std::span<const Camera> trained,
                           std::span<const Camera> held_out);

}  // namespace raysplats
