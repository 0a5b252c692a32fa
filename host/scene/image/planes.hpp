// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "raysplats/image.hpp"

namespace raysplats {

/// The picture whose channels lie one behind the other in `planes`, each height x width.
Image interleaved(const std::vector<float>& planes, int width, int height, int channels);

/// The other way round.
std::vector<float> planes_of(const Image& image);

}  // namespace raysplats
