// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>

#include "raysplats/gaussians.hpp"

namespace raysplats {

/// What `raysplats info` says about a model. Lengths are in world units; all zero for an empty
/// model.
struct ModelSummary {
  static constexpr std::size_t kOpacityBins = 10;

  std::size_t count = 0;
  int sh_degree = 0;
  std::array<double, 3> minimum{};  ///< of the means
  std::array<double, 3> maximum{};
  std::array<double, 3> inner_minimum{};  ///< 1 % quantile of the means per axis
  std::array<double, 3> inner_maximum{};  ///< 99 % quantile
  std::array<double, 5>
      scale_quantiles{};         ///< of all standard deviations: minimum, 5 %, 50 %, 95 %, maximum
  double median_anisotropy = 0;  ///< median of largest over smallest standard deviation
  double mean_opacity = 0;
  std::array<std::size_t, kOpacityBins> opacity_histogram{};  ///< equal bins over [0, 1]
};

ModelSummary summarize(const Gaussians& model);

}  // namespace raysplats
