// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "raysplats/image.hpp"

namespace raysplats {

/// Throws UsageError, which names `what` ("The render of a.png"), unless the image has pixels,
/// channels and as many numbers as these say.
void check_image(const Image& image, const std::string& what);

}  // namespace raysplats
