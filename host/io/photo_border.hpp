// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "raysplats/dataset.hpp"

namespace raysplats::io {

/// Gives views the black border that all photos of their size have (View::border): the bars of a
/// letterboxed video, what lies around the circle of a fisheye. At most eight training photos of a
/// size tell, evenly spread, and one that has no black edge tells at once; fewer than three tell of
/// nothing, and what cannot be read of nothing either.
///
/// A border ends in the same places in at least half of the photos, and, but for fisheyes, along
/// nearly straight lines: a black ground around a body, or a night sky, does not.
void find_borders(std::vector<View>& views);

/// Of the photo's pixels, those that the border takes.
double hidden_share(const PhotoBorder& border);

}  // namespace raysplats::io
