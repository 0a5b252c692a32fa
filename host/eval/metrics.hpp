// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "raysplats/image.hpp"

namespace raysplats {

/// Decibels of a picture that is its photo, and the most that is reported of any: no rounding of
/// 8-bit numbers is finer.
constexpr double kMostPsnr = 100.0;

/// Peak signal-to-noise ratio in decibels for a peak of 1, over all pixels and channels; infinity
/// for equal images. Throws UsageError when the sizes differ or there is nothing to compare.
double psnr(const Image& image, const Image& photo);

/// The same where each pixel counts as much as its weight (one channel), at least one of which is
/// above 0.
double weighted_psnr(const Image& image, const Image& photo, const Image& weight);

/// PSNR over the pixels of weight > 0 (`weight`: one channel), each counting as much as its weight,
/// after the affine map of colours (3 x 4, least squares over the same pixels) that brings the
/// image closest to the photo, clamped to [0, 1]. Throws UsageError like psnr().
double corrected_psnr(const Image& image, const Image& photo, const Image& weight);

/// The image after that map, not clamped.
Image color_corrected(const Image& image, const Image& photo, const Image& weight);

/// Structural similarity (Wang et al. 2004), mean over pixels and channels, in double precision:
/// Gaussian window of sigma 1.5 and 11 x 11 pixels, C1 = 0.01^2, C2 = 0.03^2, population
/// covariance. As scikit-image's structural_similarity(gaussian_weights=True, sigma=1.5,
/// use_sample_covariance=False, data_range=1), which leaves out the 5 pixels along the borders.
/// Images smaller than the window, which scikit-image refuses, are reflected at their edges and
/// averaged over all pixels. (The training loss has zeros beyond the borders instead.) Throws
/// UsageError like psnr(). On all cores; their number does not change a bit.
double ssim(const Image& image, const Image& photo);

/// The same as a mean of the pixels by their weights (one channel, >= 0), at least one of which is
/// above 0. The windows around them see the other pixels too, so that those should be equal. Where
/// all weight lies along the borders, these count as in images that are smaller than the window.
double weighted_ssim(const Image& image, const Image& photo, const Image& weight);

}  // namespace raysplats
