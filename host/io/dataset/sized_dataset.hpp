// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>

#include "raysplats/dataset.hpp"

namespace raysplats::io {

/// By what sizes of photos are divided, for a data set that was read as the options say; what is
/// known by decoded photos (borders, transparency) is not known yet. `in_files`: by what they are
/// divided as they were read, more than 1 where all there is are reduced copies (images_2).
using DownscaleChoice = std::function<double(const Dataset& dataset, double in_files)>;

/// load_dataset() with the `downscale` that `choose` finds once the views are known: nothing is
/// decoded or told twice, but for what files say where photos of the new size lie in a folder of
/// their own. `choose` may be empty.
Dataset load_sized_dataset(const std::filesystem::path& path,
                           DatasetOptions options,
                           const DownscaleChoice& choose);

}  // namespace raysplats::io
