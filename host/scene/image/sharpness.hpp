// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "raysplats/image.hpp"

namespace raysplats {

/// Fills a row of brightness, width numbers.
using BrightnessRow = std::function<void(int y, double* row)>;

/// How sharp a picture is, compared with others of the same thing: the mean square of the Laplacian
/// of its brightness (Pech-Pacheco et al. 2000).
double sharpness(const Image& image);
/// The sharpness of a picture that is kept in another way. Rows are read once, in order.
double sharpness(int width, int height, const BrightnessRow& read);

}  // namespace raysplats
