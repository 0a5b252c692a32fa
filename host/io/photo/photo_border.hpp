// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "io/image/image_codec.hpp"
#include "raysplats/dataset.hpp"

namespace raysplats::io {

/// Gives views the black border that all photos of their size have (View::border): the bars of a
/// letterboxed video, what lies around the circle of a fisheye or an endoscope. Few folders that
/// hold many photos each have borders of their own, as several clips. At most eight training photos
/// tell, evenly spread, and one that has no black edge tells at once; fewer than three tell of
/// nothing, and what cannot be read of nothing either.
///
/// A border ends in the same places in most of these photos, along straight lines, bent ones near
/// the photo's edge, or on a circle. So does a black ground around a body on a turntable: there the
/// cameras look at one place from around it, so exactly that the edges are the outline of one
/// cylinder or ball for all of them, and no border is found.
void find_borders(std::vector<View>& views);

/// Whether the photo of a view has the border that was found in others, and shows no more than
/// letters there: of two videos of one size one may have bars.
bool has_border(const RawImage& photo, const View& view);

/// Of the photo's pixels, those that the border takes.
double hidden_share(const PhotoBorder& border);

}  // namespace raysplats::io
