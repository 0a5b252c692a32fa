// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "raysplats/camera.hpp"
#include "raysplats/dataset.hpp"
#include "train/start/photo_set.hpp"

namespace raysplats {

/// Ways in which poses are written that readers take for each other.
enum class PoseReading {
  kOtherAxes,         ///< OpenGL's camera axes (y up, z backward) for OpenCV's (y down, z forward),
                      ///< or the reverse
  kInverse,           ///< camera to world for world to camera, or the reverse, as OpenCV's axes
  kInverseOtherAxes,  ///< the same, as OpenGL's axes
};

/// The camera, had its pose been written the other way. Camera axes are OpenCV's in either case; a
/// world that is turned as a whole is the same.
Camera read_as(Camera camera, PoseReading reading);

/// A reading in which photos agree clearly better than as they are.
struct BetterReading {
  PoseReading reading = PoseReading::kOtherAxes;
  double agreed = 0;  ///< the share of what photos show, as of a sweep
};

/// Looks for a reading of the poses in which photos agree in one depth at least at an eighth of
/// what they show, and at 2.5 times as much as as they are (`agreed`). Nothing where there is none,
/// as with sound poses, and where so much agrees already.
std::optional<BetterReading> better_reading(std::span<const SmallPhoto> photos,
                                            double agreed,
                                            std::uint64_t seed);

/// Warns where poses of the data set seem to be written otherwise than files of its kind have them.
/// `agreed`: the share of what the photos show that a sweep finds in one depth.
void check_poses(const Dataset& dataset,
                 std::span<const SmallPhoto> photos,
                 double agreed,
                 std::uint64_t seed);

}  // namespace raysplats
