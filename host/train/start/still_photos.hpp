// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <glm/vec2.hpp>
#include <span>
#include <vector>

#include "train/start/photo_set.hpp"

namespace raysplats {

// What the search for marks (still_marks.hpp) and that for a ground (still_ground.hpp) share.

/// Difference of a channel between the neighbours on either side of an edge, along its direction.
/// Noise of JPEG has less.
constexpr float kLeastStep = 12.0f / 255;
/// One photo in so many may have another edge there.
constexpr std::size_t kOddOneIn = 10;

/// The photos of the size that most have.
std::vector<SmallPhoto> of_one_size(std::span<const SmallPhoto> photos);
/// camera_extent() of their cameras.
double extent_of(std::span<const SmallPhoto> photos);
/// What a channel of a photo's pixel differs from left to right and from top to bottom; 0 beside
/// what masks leave out.
glm::vec2 step_at(const io::Photo& photo, int x, int y, std::size_t channel);
/// Whether a thing of the scene may be seen at the same place of most photos.
bool may_be_seen(std::span<const SmallPhoto> photos, const glm::dvec2& place, double extent);

}  // namespace raysplats
