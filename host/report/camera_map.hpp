// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace raysplats::report {

/// Where the cameras of a run stand, from above and from the side, as two SVGs: those that were
/// trained on with where they look, and larger the held-out ones, each kind coloured by its PSNR.
/// Up is the mean of what is up in the photos. `views` as in metrics.json of an evaluation,
/// `photos` as in that of the run; photos without a PSNR are grey. Empty without cameras.
std::string camera_map(const std::filesystem::path& run,
                       const std::vector<nlohmann::json>& views,
                       const std::vector<nlohmann::json>& photos);

}  // namespace raysplats::report
