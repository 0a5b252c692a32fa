// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <glm/vec2.hpp>
#include <span>

#include "raysplats/camera.hpp"

namespace raysplats::io {

/// Points that tell enough of an edge.
inline constexpr std::size_t kOutlinePoints = 16;
/// Edges that miss the outline of a body by less, as outline_misfit() says, may be one: those of
/// rendered turntables do, borders painted into captures by hand that look around miss it by more.
inline constexpr double kMostOutlineMisfit = 0.05;

/// A point of an edge that the photos of several cameras have in the same place.
struct EdgePoint {
  glm::dvec2 place{0.0};   ///< pixels
  glm::dvec2 inward{0.0};  ///< of length 1, across the edge to where something is shown
};

/// A body that looks the same from all sides, as others do whose photos are laid over each other.
enum class RoundBody {
  kCylinder,  ///< straight edges, along its axis
  kBall,      ///< edges on a circle
};

/// How far an edge is from being the outline of one and the same body in the photos of all cameras:
/// the distances of the body's surface from the rays that should touch it, in the root mean square,
/// as a share of the radius of the body that fits best. Infinity where none stands before all
/// cameras, for no points, and for straight edges that lie across each other.
double outline_misfit(std::span<const Camera> cameras,
                      std::span<const EdgePoint> edge,
                      RoundBody shape);

/// Whether the cameras look in directions so different that the photos of few scenes and bodies
/// fit one outline; any outline fits photos that were taken from one side.
bool look_around(std::span<const Camera> cameras);

}  // namespace raysplats::io
