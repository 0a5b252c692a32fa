// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "io/dataset/colmap_model.hpp"

namespace raysplats::io {

/// Gives a model, whose images are known, their cameras of a cameras.bin; others of the file are
/// left out, whatever their lens. Throws DataError with the byte offset for malformed files and for
/// camera models that read_colmap_model() does not name.
void read_cameras_binary(const std::filesystem::path& path, ColmapModel& model);

/// The same of a cameras.txt; errors have the line.
void read_cameras_text(const std::filesystem::path& path, ColmapModel& model);

}  // namespace raysplats::io
