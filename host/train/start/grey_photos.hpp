// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "train/start/photo_set.hpp"

namespace raysplats {

/// Numbers of the photos that have no colour where others show some: no pixel of them differs from
/// grey, as of photos that a program has made grey, or of a camera without colours. None where all
/// photos have no colour, or few colours (a grey subject), and where those from the nearest places
/// have little (what is seen from there may be grey). Photos that show next to nothing, as all
/// black ones, count neither here nor there.
std::vector<std::size_t> grey_photos(std::span<const SmallPhoto> photos);

}  // namespace raysplats
