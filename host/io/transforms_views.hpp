// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "io/transforms.hpp"
#include "raysplats/dataset.hpp"

namespace raysplats::io {

/// Whether a photo of any frame is there.
bool has_photos(const TransformsFile& file);

/// The views of a transforms file, in its order. Frames without a photo leave the file, with a
/// warning where most have one. Throws DataError for masks and depth maps that are named and not
/// there, and where most photos are missing.
std::vector<View> transforms_views(TransformsFile& file, const DatasetOptions& options);

}  // namespace raysplats::io
