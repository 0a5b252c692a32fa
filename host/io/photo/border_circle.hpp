// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <glm/vec2.hpp>
#include <optional>
#include <span>

#include "io/photo/black_edges.hpp"
#include "raysplats/camera.hpp"

namespace raysplats::io {

/// A circle in a photo, pixels.
struct Circle {
  glm::dvec2 center{0.0};
  double radius = 0;

  /// How far a point lies off it.
  double off(const glm::dvec2& point) const;
};

/// The circle that something is shown in, as that of a fisheye, which a photo may cut.
std::optional<Circle> circle_of(const BlackEdges& edges);

/// Whether the circle is that of the lens. Where all cameras see the outline of one ball in it, it
/// may be that of a body; fisheyes that look to one side alone are believed.
bool is_of_lens(const Circle& circle, const BlackEdges& edges, std::span<const Camera> cameras);

}  // namespace raysplats::io
