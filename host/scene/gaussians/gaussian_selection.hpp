// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "raysplats/bounds.hpp"
#include "raysplats/gaussians.hpp"

namespace raysplats {

/// The Gaussians of these indices, in this order.
Gaussians gathered(const Gaussians& model, std::span<const std::uint32_t> indices);

/// The indices of Gaussians whose means lie within the box, borders included.
std::vector<std::uint32_t> within(const Gaussians& model, const Bounds& box);

/// Numbers of the Gaussians of at least this opacity, 0 to 1.
std::vector<std::uint32_t> with_opacity(const Gaussians& model, double least);

/// What each Gaussian can give to pictures from anywhere: the logarithm of opacity times the area
/// of the ellipsoid's largest section, but for a constant.
std::vector<double> sections(const Gaussians& model);

/// The indices of the `most` largest weights, in their order; of equal ones the first. All where
/// there are no more.
std::vector<std::uint32_t> largest(std::span<const double> weights, std::size_t most);

}  // namespace raysplats
