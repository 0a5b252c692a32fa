// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "raysplats/image.hpp"

namespace raysplats {

/// Mean absolute difference that an error map shows as white.
constexpr float kErrorScale = 0.25f;

/// Mean absolute difference over R, G, B as a colour: black (0), red, yellow, white (`full_scale`
/// and more). Channels beyond the third are ignored. Throws UsageError when the sizes differ.
Image error_map(const Image& image, const Image& photo, float full_scale = kErrorScale);

/// Photo, render and error map from left to right as one RGB image. Throws UsageError when the
/// sizes differ.
Image side_by_side(const Image& photo, const Image& render);

}  // namespace raysplats
