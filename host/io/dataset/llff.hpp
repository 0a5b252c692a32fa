// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>

#include "io/dataset/transforms.hpp"

namespace raysplats::io {

/// The name of LLFF's file of poses.
constexpr const char* kLlffPoses = "poses_bounds.npy";

/// The cameras of LLFF's poses_bounds.npy (Mildenhall et al. 2019): a row of 17 numbers for every
/// photo of the folder `photos`, in the order of their names. They are 3 x 5, row by row, which are
/// the camera's axes down, right and back, its place, and height, width and focal length, and the
/// least and the greatest depth, which are not used. Throws DataError for another shape, for as
/// many photos as there are no rows, and as read_transforms() for what the numbers say.
TransformsFile read_llff(const std::filesystem::path& path, const std::filesystem::path& photos);

}  // namespace raysplats::io
