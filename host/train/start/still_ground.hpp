// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <span>

#include "train/start/photo_set.hpp"

namespace raysplats {

/// What stands still in photos though their cameras are said to move.
struct StillGround {
  std::size_t photos = 0;  ///< those of one kind that have it
  double edges = 0;        ///< the share of what has edges in one of these
};

/// The ground behind a body that turned before a camera which stood, whose poses say that it went
/// around: large parts that are the same at the same pixels, though the cameras' rays through them
/// meet nowhere. It may be another for each height of the camera, so groups of alike photos tell,
/// of five or more; nothing where there is no such ground.
std::optional<StillGround> still_ground(std::span<const SmallPhoto> photos);

}  // namespace raysplats
