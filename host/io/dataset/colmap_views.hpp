// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <vector>

#include "io/dataset/colmap_model.hpp"
#include "raysplats/dataset.hpp"

namespace raysplats::io {

/// The views of the COLMAP model in `model_folder`, whose photos lie below `root`, in the model's
/// order; those without a photo are left out with a warning where most have one. A mask has the
/// whole name of its image, or its file name where no other image has that. Throws DataError.
std::vector<View> colmap_views(const ColmapModel& model,
                               const std::filesystem::path& model_folder,
                               const std::filesystem::path& root,
                               const DatasetOptions& options);

}  // namespace raysplats::io
