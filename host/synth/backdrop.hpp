// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>

#include "synth/shapes.hpp"

namespace raysplats::synth {

/// The displayed colour of a ray that meets no object.
using Backdrop = std::function<glm::dvec3(const Ray&)>;

/// A painted wall behind the still life, 3 units from the origin in the direction of Y.
Backdrop painted_wall(std::uint64_t seed);
/// Six papered walls around the still life, each kRoomSide from the origin.
constexpr double kRoomSide = 3.0;
Backdrop papered_room(std::uint64_t seed);
/// Meadow to the horizon, hills 60 units away, clouds at infinity.
Backdrop open_country(std::uint64_t seed);

}  // namespace raysplats::synth
