// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "device/kernel.hpp"
#include "shared/train_layout.h"
#include "trace/parameters.hpp"

namespace raysplats {

/// A launch over all groups of parameters (cl/train/parameter_groups.h).
struct GroupParts {
  Range range;
  RsParts parts;
};

/// That of work-groups of `group` work-items, of `floats` floats each, over the parameters of
/// `count` Gaussians.
GroupParts group_parts(std::size_t count, int sh_degree, std::size_t group, std::size_t floats = 1);

/// That of one work-item for every block of Gaussians and group of parameters.
GroupParts group_blocks(std::size_t blocks);

}  // namespace raysplats
