// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>

#include "raysplats/camera.hpp"

namespace raysplats::cli {

/// What a file is that is neither a model nor a mesh nor a scene: cameras, a camera path, rays and
/// other arrays, a picture, a checkpoint or a configuration; nothing where name and content are
/// none of these. "type" says which. Throws what the readers of the files throw.
std::optional<nlohmann::ordered_json> describe_file(const std::filesystem::path& path);

/// The same for people, a line for every fact.
void print_file(const nlohmann::ordered_json& file);

/// As scene files call it.
const char* model_name(CameraModel model);

}  // namespace raysplats::cli
