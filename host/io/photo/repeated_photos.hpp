// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "raysplats/dataset.hpp"

namespace raysplats::io {

/// Photos that are trained on measure nothing: those that are held out too, under the same name or
/// as a copy of the file, are trained on no more, unless they are most of the photos. Warns of
/// them, and of photos that several views of one side have.
void settle_repeated_photos(std::vector<View>& views);

}  // namespace raysplats::io
