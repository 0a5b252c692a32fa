// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "io/dataset/transforms.hpp"
#include "io/photo/photo_mask.hpp"
#include "raysplats/dataset.hpp"

namespace raysplats::io {

/// Whether a photo of any frame is there.
bool has_photos(const TransformsFile& file);

/// Tells the finder of masks of all photos that a file names.
void add_photos(const TransformsFile& file, MaskFinder& masks);

/// The views of a transforms file, in its order; masks that it does not name are those of `masks`,
/// which knows the photos of the whole data set. Frames without a photo leave the file, with a
/// warning where most have one. Throws DataError for masks and depth maps that are named and not
/// there, and where most photos are missing.
std::vector<View> transforms_views(TransformsFile& file,
                                   const DatasetOptions& options,
                                   const MaskFinder& masks);

/// Throws DataError where two frames of the data set, whose views have been made, name different
/// paths but have one photo, found by the end of a path: one of them is another camera's.
void require_photos_of_their_own(const std::vector<const TransformsFile*>& files);

}  // namespace raysplats::io
