// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace raysplats {

/// The candidate with the smallest Levenshtein distance to `name`; "" where none is near enough to
/// be what was meant: one change and another for every four characters, dashes in front not
/// counted.
std::string nearest_name(std::string_view name, const std::vector<std::string>& candidates);

/// How a message about an unknown name ends: ": did you mean 'x'?" with the nearest name, without
/// one
/// ": use 'x', 'y' or 'z'" where there are but a few candidates, else `otherwise`.
std::string did_you_mean(std::string_view name,
                         const std::vector<std::string>& candidates,
                         const std::string& otherwise = "");

}  // namespace raysplats
