// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace raysplats::report {

/// What somebody should know of a run before looking at its pictures, a sentence each without its
/// full stop: from its metrics.json, its settings, the columns of its metrics.csv, and the views of
/// its last evaluation.
std::vector<std::string> warnings_of(const nlohmann::json& metrics,
                                     const std::map<std::string, std::string>& settings,
                                     const std::map<std::string, std::vector<double>>& columns,
                                     const std::vector<nlohmann::json>& views);

/// The whole in one sentence: whether the run is over, how good its last evaluation was, and how
/// many warnings follow.
std::string verdict(const nlohmann::json& metrics, std::size_t warnings);

/// For a console: how many warnings the page in `file` has, and the first; "" for none.
std::string warnings_line(const std::vector<std::string>& warnings,
                          const std::filesystem::path& file);

}  // namespace raysplats::report
