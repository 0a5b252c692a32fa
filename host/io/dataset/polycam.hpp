// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <optional>

#include "io/dataset/transforms.hpp"

namespace raysplats::io {

/// Where a raw export of Polycam has its cameras and photos.
struct PolycamFolders {
  std::filesystem::path cameras;  ///< NAME.json
  std::filesystem::path photos;   ///< NAME.jpg
  std::filesystem::path depths;   ///< NAME.png, or not there
};

/// Those below a data set: in keyframes, or in the folder itself; the corrected ones, where a
/// capture has been processed, whose poses are adjusted and whose photos have no distortion.
std::optional<PolycamFolders> find_polycam(const std::filesystem::path& root);

/// The cameras of such an export. Its world has y up; that of the result has z up, as nerfstudio
/// turns it. Depth maps, in millimetres, are named where they are there. Throws DataError as
/// read_transforms(), and for a camera without a number that it needs.
TransformsFile read_polycam(const PolycamFolders& folders, const std::filesystem::path& root);

}  // namespace raysplats::io
