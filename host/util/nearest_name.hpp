// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace raysplats {

/// The candidate with the smallest Levenshtein distance to `name` among those that may have been
/// meant: with one change (two from three characters on, another for every four), or one that holds
/// the other whole (four characters at least). Dashes in front do not count. "" where there is
/// none.
std::string nearest_name(std::string_view name, const std::vector<std::string>& candidates);

/// How a message about an unknown name ends: ": did you mean 'x'?" with the nearest name; where
/// none is near ": use 'x', 'y' or 'z'" of a few candidates, else `otherwise`.
std::string did_you_mean(std::string_view name,
                         const std::vector<std::string>& candidates,
                         const std::string& otherwise = "");

}  // namespace raysplats
