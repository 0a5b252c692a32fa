// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

namespace raysplats {

/// What a run goes on to say of itself in metrics.json once it is resumed. `former` is what it said
/// before, null where nothing is known; members that are missing or of another type count as
/// unknown.

/// `now` is of the part since then, and of all of the run where checkpoints know it. Returns what
/// is true of all of it: the command that started it, all "commands" in their order, the kernels of
/// all timed steps on this device, the most memory, the time for building kernels. Without a step
/// since then what steps said stays as it was.
nlohmann::json continued_metrics(nlohmann::json now, const nlohmann::json& former, bool stepped);

/// The facts about each training photo, by its name.
std::map<std::string, nlohmann::json> former_photos(const nlohmann::json& former);

/// What a run has warned of in its photos.
std::vector<std::string> former_warnings(const nlohmann::json& former);

/// A number of it; 0 where it is unknown.
double former_number(const nlohmann::json& former, const char* key);

}  // namespace raysplats
