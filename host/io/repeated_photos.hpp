// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "raysplats/dataset.hpp"

namespace raysplats::io {

/// Photos that are trained on measure nothing: those that are held out too, under the same name or
/// as a copy of the file, are trained on no more, unless they are most of the photos. Warns of
/// them.
void part_held_out(std::vector<View>& views);

/// Warns of photos that several views of one side have. Of photos on both sides part_held_out()
/// tells.
void warn_of_repeated_photos(std::span<const View> views);

}  // namespace raysplats::io
