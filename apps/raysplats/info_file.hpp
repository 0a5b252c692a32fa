// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>

#include "raysplats/camera.hpp"
#include "raysplats/scene.hpp"

namespace raysplats::cli {

/// What a file is that is neither a model nor a mesh nor a scene: cameras, a camera path, rays and
/// other arrays, a picture, a checkpoint, a configuration, or what info_parts.hpp has; nothing
/// where name and content are none of these. "type" says which. Throws what the readers of the
/// files throw.
std::optional<nlohmann::ordered_json> describe_file(const std::filesystem::path& path);

/// The same for people, a line for every fact.
void print_file(const nlohmann::ordered_json& file);

/// Number, sizes and lenses of cameras.
nlohmann::ordered_json describe_cameras(std::span<const Camera> cameras);

/// The least and the greatest x, y and z of positions, which are 3 numbers each.
nlohmann::ordered_json bounds_of(std::span<const float> positions);

/// As scene files call them.
const char* model_name(CameraModel model);
const char* material_kind(Material::Kind kind);

}  // namespace raysplats::cli
