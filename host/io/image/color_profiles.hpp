// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "raysplats/dataset.hpp"

namespace raysplats::io {

/// Warns where photos say that their colours are other than sRGB's (Display P3 of telephones, Adobe
/// RGB of cameras, ACEScg of renderers), or PNGs that their numbers are not display values (a gAMA
/// of light), which are not converted. Looks at five photos, evenly spread.
void warn_of_color_profiles(std::span<const View> views);

}  // namespace raysplats::io
