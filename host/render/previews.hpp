// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "raysplats/camera.hpp"
#include "raysplats/image.hpp"

namespace raysplats {

/// The mean of every factor x factor block. Sizes are multiples of `factor`.
Image box_average(const Image& image, int factor);

/// Expected depth (1 channel) as grey in [0, 1]: the nearest pixel 1, the farthest 0. Pixels whose
/// alpha (last channel of `alpha`) is below one half are 0 and do not count.
Image depth_preview(const Image& depth, const Image& alpha);

/// The first channel of Tracer::depth(): expected depth.
Image expected_of(const Image& depth);

/// The third channel of Tracer::depth(): numbers of hits.
Image hits_of(const Image& depth);

/// Tracer::normals() made as long as 1, where they have a direction.
Image unit_normals(Image sums);

/// Normals in world axes (3 channels) in the colours of the camera's axes: red to the right, green
/// up, blue towards the camera, 0.5 in the middle. Pixels whose alpha (last channel of `alpha`) is
/// below one half are 0.
Image normals_preview(const Image& normals, const Image& alpha, const Camera& camera);

/// Number of hits (1 channel) as grey in [0, 1]: as many as the pixel with the most 1, none 0.
Image hits_preview(const Image& hits);

}  // namespace raysplats
