// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "raysplats/camera.hpp"
#include "raysplats/dataset.hpp"
#include "raysplats/image.hpp"
#include "scene/image/pixel_mask.hpp"

namespace raysplats {

/// A photo beside a model's picture of it.
struct ComparedPhoto {
  Camera camera;             ///< that takes pictures of this size
  std::vector<float> error;  ///< fitted_error()
  std::vector<float> depth;  ///< ViewTracer::depth(), the median one; 0 where nothing is
};

/// How far a picture is from its photo in each pixel: the root mean square over R, G and B of the
/// mean difference of 3 x 3 pixels, once an affine map has brought the picture's colours as near to
/// the photo's as it can (least squares whose weights fall with the difference, so that what moves
/// has little say). Three channels each, and one of `weight`, by which pixels count; not a number
/// where they do not. Throws UsageError when sizes differ.
std::vector<float> fitted_error(const Image& picture, const Image& photo, const Image& weight);

/// Of each photo, what it shows of things that move or change: pixels that are far from the model
/// although most of up to 16 photos that see the same place are near to it there. A place where all
/// of them are far is one that the model lacks. Far is an error of 0.05 that is joined to one of
/// 0.12, or three and six times the median of all where that is more; a pixel all around is marked
/// too, and what is joined to these and seen by fewer than four others. A place is the median depth
/// of the model, and seen by a photo whose pixel there counts and whose own depth is not less than
/// 0.85 of its distance. O(photos^2 + photos x pixels).
std::vector<PixelMask> moving_areas(std::span<const ComparedPhoto> photos);

/// A mask of the view's photo as it is on disk, with its lens: 0 where the picture that loading
/// makes of it shows what `moving` marks, 1 elsewhere. 384 pixels at most on its longer side.
Image counted_in_photo(const PixelMask& moving, const View& view);

}  // namespace raysplats
