// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>
#include <vector>

#include "raysplats/camera.hpp"

namespace raysplats::io {

/// The cameras of a cameras.json as RunFolder::write_cameras() and other trainers of 3DGS write it:
/// principal point and lens by the keys of a transforms.json. Without these keys, as others write
/// it, they are pinholes that look through the middle of their pictures, or panoramas where there
/// are no focal lengths. Nothing for entries that are no view with position, rotation, width and
/// height, or whose lens cannot be read. Throws DataError for a file that is no JSON.
std::vector<std::optional<Camera>> read_camera_list(const std::filesystem::path& path);

/// Whether a file begins as a JSON list, as cameras.json does and a transforms.json does not; not
/// when it cannot be read.
bool is_camera_list(const std::filesystem::path& path);

/// The same list where every entry has to be a view: throws DataError that names the first that is
/// none. Views without a name are called frame_0000 and so on. A line says where they are taken
/// for pinholes because the list names no lenses.
std::vector<Camera> read_listed_views(const std::filesystem::path& path);

/// read_cameras() for a model that counts from `origin`: those of a transforms file count from the
/// world's and are moved, a list lies beside its model and counts as that does.
std::vector<Camera> read_model_cameras(const std::filesystem::path& path, const glm::dvec3& origin);

}  // namespace raysplats::io
