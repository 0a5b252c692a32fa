// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>

#include "raysplats/image.hpp"

namespace raysplats {

/// Fills a row of brightness, width numbers.
using BrightnessRow = std::function<void(int y, double* row)>;

/// How sharp a picture is, compared with others of the same thing: the mean square of the Laplacian
/// of its brightness (Pech-Pacheco et al. 2000).
struct Sharpness {
  double fine = 0;  ///< of its pixels
  /// Of the picture reduced to some 24 pixels of its longer side, which blur leaves as it is: where
  /// this is as low as `fine`, there is little to see.
  double coarse = 0;
};

Sharpness sharpness(const Image& image);
/// The sharpness of a picture that is kept in another way. Rows are read once, in order.
Sharpness sharpness(int width, int height, const BrightnessRow& read);

}  // namespace raysplats
