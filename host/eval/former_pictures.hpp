// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <set>
#include <string>
#include <vector>

#include "raysplats/evaluation.hpp"

namespace raysplats {

/// The pictures, as files in the folder, that an evaluation before this one has written there, by
/// its metrics.json. None in a data set's folder, where they may be photos again.
std::set<std::string> former_pictures(const std::filesystem::path& folder);

/// The names, without extension, of the pictures of the split's views that an evaluation writes or
/// removes. Where not all views are shown, which ones are is known only at its end: those of
/// `former` alone.
std::vector<std::string> replaced_names(const std::set<std::string>& former,
                                        const Dataset& dataset,
                                        Split split,
                                        bool all_shown);

/// Removes those of `former` that `report` does not name.
void remove_former_pictures(const std::filesystem::path& folder,
                            std::set<std::string> former,
                            const EvaluationReport& report);

}  // namespace raysplats
