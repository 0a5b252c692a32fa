// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <optional>
#include <vector>

#include "raysplats/bounds.hpp"
#include "raysplats/gaussians.hpp"

namespace raysplats {

/// What `raysplats convert` changes of a model, in this order.
struct ModelChanges {
  std::optional<double> min_opacity;  ///< 0 to 1: fainter Gaussians are left out
  std::optional<glm::dvec3> up;       ///< this direction becomes up, the -y of model files
  double scale = 1.0;                 ///< factor of all lengths, above 0
  glm::dvec3 rotate_degrees{0.0};     ///< about the axes x, then y, then z
  glm::dvec3 translate{0.0};          ///< world units
  std::optional<Bounds> crop;         ///< in the coordinates of the result, borders included
  /// Keeps the Gaussians of the greatest `contributions`; without these, by opacity times the area
  /// of the ellipsoid's largest section, which is what they can give to pictures from anywhere.
  std::optional<std::size_t> max_gaussians;
  std::vector<double> contributions;  ///< of each Gaussian, as by raysplats::contributions()
  std::optional<int> sh_degree;       ///< 0 to 4: bands are dropped, or added as zero
};

/// The model with these changes; what is left keeps its order, and harmonics turn as well. Throws
/// UsageError for a number out of range, an `up` of length 0 and a box whose least is above its
/// greatest, for another number of contributions than of Gaussians, and for arrays of Gaussians
/// that do not fit each other.
Gaussians changed(Gaussians model, const ModelChanges& changes);

}  // namespace raysplats
