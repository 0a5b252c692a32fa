// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>

#include "raysplats/scene.hpp"

namespace raysplats::reference {

/// Bilinear between texel centres; x = 1 is the image's width, y = 1 its height. Repeats in x, and
/// in y too where `repeat_y`, else y is held at the borders.
glm::dvec3 sampled(const Image& image, double x, double y, bool repeat_y);

/// What docs/light.md says of the environment.
class EnvironmentLight {
 public:
  explicit EnvironmentLight(const Environment& environment);

  /// Seen along a unit direction.
  glm::dvec3 seen(const glm::dvec3& direction) const;
  /// Its cosine-weighted mean over the hemisphere of a unit normal, from nine coefficients.
  glm::dvec3 on_normal(const glm::dvec3& normal) const;

 private:
  Environment environment_;
  glm::dmat3 axes_{1.0};  ///< columns: right, up, forward (to the image's centre)
  std::array<glm::dvec3, 9> coefficients_{};
};

}  // namespace raysplats::reference
