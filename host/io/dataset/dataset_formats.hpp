// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "raysplats/dataset.hpp"

namespace raysplats::io {

/// The views and points of the data set in a folder, of whatever format it is; no photo is decoded.
/// Throws DataError for a folder of no format, which says what to do.
Dataset read_data_folder(const std::filesystem::path& root, const DatasetOptions& options);

/// The same of a transforms file that was named, whatever else lies beside it: those of Blender
/// belong together, any other is the only one that is read.
Dataset read_named_transforms(const std::filesystem::path& file, const DatasetOptions& options);

}  // namespace raysplats::io
