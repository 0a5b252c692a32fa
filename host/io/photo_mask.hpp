// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "raysplats/dataset.hpp"

namespace raysplats::io {

/// Where masks lie that nothing names; ScanNet++ has a name of its own.
std::filesystem::path mask_folder(const std::filesystem::path& root);

/// A mask of the photo `name` in mask_folder(), and nowhere else: COLMAP's name.ext.png, or an
/// image that is called as the photo, with "_mask" or ".mask" behind it or without; empty where
/// there is none. Of a name that is absolute or leads upwards inner_name() counts.
std::filesystem::path find_mask(const std::filesystem::path& root,
                                const std::filesystem::path& name);

/// Throws DataError unless the mask has the photo's shape, not necessarily its size; it may be
/// turned as EXIF says.
void check_mask(const View& view);

}  // namespace raysplats::io
