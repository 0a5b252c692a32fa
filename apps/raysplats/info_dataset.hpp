// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

#include "raysplats/dataset.hpp"

namespace raysplats::cli {

/// Views, sizes and lenses of a data set. Throws what load_dataset() throws.
nlohmann::ordered_json describe_dataset(const std::filesystem::path& path,
                                        const DatasetOptions& options);

/// The same for people.
void print_dataset(const nlohmann::ordered_json& dataset);

}  // namespace raysplats::cli
