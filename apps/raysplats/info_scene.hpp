// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <nlohmann/json.hpp>

namespace raysplats::cli {

/// Whether a file holds a mesh, and no Gaussians: by its extension, of a PLY or glTF by its
/// content.
bool is_mesh(const std::filesystem::path& path);

/// Triangles and materials of a mesh. Throws what io::read_mesh() throws.
nlohmann::ordered_json describe_mesh(const std::filesystem::path& path);
void print_mesh(const nlohmann::ordered_json& mesh);

/// What a scene file places, lights and looks at. Throws what read_scene_file() throws.
nlohmann::ordered_json describe_scene(const std::filesystem::path& path);
void print_scene(const nlohmann::ordered_json& scene);

}  // namespace raysplats::cli
