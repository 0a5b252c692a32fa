// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "raysplats/gaussians.hpp"
#include "raysplats/model_changes.hpp"

namespace raysplats {

/// The Gaussians of these indices, in this order.
Gaussians gathered(const Gaussians& model, std::span<const std::uint32_t> indices);

/// The Gaussians whose means lie within the box, borders included.
Gaussians within(const Gaussians& model, const CropBox& box);

/// The Gaussians of at least this opacity, 0 to 1.
Gaussians with_opacity(const Gaussians& model, double least);

/// The `most` Gaussians that contribute most to pictures from anywhere, in their order: by opacity
/// times the area of the ellipsoid's largest section. All where there are no more.
Gaussians most_contributing(const Gaussians& model, std::size_t most);

}  // namespace raysplats
