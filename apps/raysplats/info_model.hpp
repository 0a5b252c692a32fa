// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

namespace raysplats::cli {

/// A model, or the newest of a run folder: how many Gaussians, where and how large they are, and
/// how it is traced. "type" says which of both. Throws what find_model() and read_model() throw.
nlohmann::ordered_json describe_model(const std::filesystem::path& path);

/// The same for people, read from the file too.
void print_model(const std::filesystem::path& path);

}  // namespace raysplats::cli
