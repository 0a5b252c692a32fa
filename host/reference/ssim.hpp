// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

namespace raysplats::reference {

/// Structural similarity (Wang et al. 2004) of one channel, 11 x 11 Gaussian window of sigma 1.5,
/// C1 = 0.01^2, C2 = 0.03^2, images zero outside their borders (3DGS's convention), by the direct
/// double sum.
struct Ssim {
  std::vector<double> map;  ///< height x width
  double mean = 0.0;
};

/// Both images are row-major width x height; throws UsageError when a size does not fit.
Ssim ssim(std::span<const double> image, std::span<const double> target, int width, int height);

/// d(mean SSIM)/d(image), width x height.
std::vector<double> ssim_gradient(std::span<const double> image,
                                  std::span<const double> target,
                                  int width,
                                  int height);

/// Peak signal-to-noise ratio in dB for a peak of 1 over all numbers; infinity when they are equal.
double psnr(std::span<const double> image, std::span<const double> target);

}  // namespace raysplats::reference
