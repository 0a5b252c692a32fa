// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "raysplats/dataset.hpp"

namespace raysplats {

/// Sixteen hexadecimal digits (xxh64) of what a data set consists of: the names, file sizes and
/// cameras of all photos on disk and the sparse points. Where the folder lies and --test-every do
/// not change it; the pixels are not read.
std::string dataset_fingerprint(const Dataset& dataset);

}  // namespace raysplats
