// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "raysplats/dataset.hpp"

namespace raysplats {

/// The cameras of some views, by their numbers in the data set.
std::vector<Camera> cameras_of(const Dataset& dataset, std::span<const std::size_t> views);
/// Of the views of a split, in their order.
std::vector<Camera> cameras_of(const Dataset& dataset, Split split);

}  // namespace raysplats
