// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "raysplats/image.hpp"

namespace raysplats {

/// How sharp a picture is, compared with others of the same thing: the mean square of the Laplacian
/// of its brightness (Pech-Pacheco et al. 2000).
double sharpness(const Image& image);

}  // namespace raysplats
