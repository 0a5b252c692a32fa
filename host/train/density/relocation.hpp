// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "raysplats/train_options.hpp"
#include "train/density/density_plan.hpp"

namespace raysplats {

/// What `parts` equal Gaussians in one place need so that together they look as one of opacity
/// `opacity` did (Rota Bulò et al. 2024; Kheradmand et al. 2024, equation 9).
struct EqualShare {
  double opacity = 0;  ///< of each: 1 - (1 - opacity)^(1 / parts), within [0.005, 1 - 1e-6]
  double scale = 1;    ///< factor of the standard deviations
};
/// Above 51 `parts` count as 51; at least 1.
EqualShare equal_share(double opacity, std::size_t parts);

/// Rules of one pass of 3DGS-MCMC.
struct RelocationRules {
  std::size_t target = 0;  ///< Gaussians after the pass, at least as many as before
  double dead_opacity = 0.005;
  std::optional<Bounds> bounds;  ///< what lies outside is dead
  std::uint64_t seed = 0;        ///< of this pass
};

/// A plan whose Gaussians, where they are shared, differ from their source.
struct RelocationPlan {
  DensityPlan density;  ///< roles kKeep and, for all parts of what is shared, kClone
  /// {opacity parameter, factor of the standard deviations} of every new Gaussian; a factor of 0
  /// where it stays as it is.
  std::vector<std::array<float, 2>> shares;
};

/// Every dead Gaussian (faint, outside or not finite) becomes a part of one that is alive, and so
/// do further ones until there are `target`: drawn with replacement and probabilities in proportion
/// to opacity, a function of the seed. Arguments as plan_density(); the density plan's `source` is
/// empty when nothing is alive. Time O(N log N).
RelocationPlan plan_relocation(std::span<const float> means,
                               std::span<const float> scales,
                               std::span<const float> opacities,
                               const RelocationRules& rules);

}  // namespace raysplats
