// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "raysplats/dataset.hpp"

namespace raysplats {

/// Sixteen hexadecimal digits (xxh64) of what a data set consists of: the names, file sizes and
/// cameras of all photos on disk and the sparse points; `with_depths` what their depth maps hold,
/// too. Where the folder lies and --test-every do not change it; the pixels of photos are not
/// read. Throws DataError for a depth map that cannot be read.
std::string dataset_fingerprint(const Dataset& dataset, bool with_depths = false);

/// The same of the names of the photos that are held out.
std::string split_fingerprint(const Dataset& dataset);

}  // namespace raysplats
