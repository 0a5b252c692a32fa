// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "arrays.hpp"
#include "raysplats/image.hpp"

namespace raysplats::python {

/// A copy of an array (height, width, channels) of at most 4 channels, or (height, width).
Image image_of(const FloatArray& array, const char* name);

/// The picture as an array (height, width, channels) that owns it.
FloatView array_of(Image image);

}  // namespace raysplats::python
