// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <string>
#include <vector>

#include "raysplats/mirrors.hpp"
#include "run/model_source.hpp"

namespace raysplats {

/// Known mirrors from mesh files (io::read_mesh). Materials that are mirrors keep their colour, all
/// others reflect everything. `origin` is taken off their positions (Dataset::origin).
Mirrors load_mirrors(const std::vector<std::string>& paths,
                     int max_bounces,
                     const std::array<double, 3>& origin = {});

/// The mirrors that a model was trained with; none for a PLY that is in no run.
Mirrors mirrors_of(const ModelSource& source);

}  // namespace raysplats
