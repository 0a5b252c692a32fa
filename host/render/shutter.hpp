// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>

#include "raysplats/camera.hpp"
#include "raysplats/image.hpp"
#include "render/frame_writer.hpp"

namespace raysplats {

/// Throws UsageError for a number of moments or a share of time out of range.
void check_shutter(const FrameOptions& options);

/// How far moment `k` of a frame's lies on the way to the next frame.
double moment(const FrameOptions& options, int k);

/// The camera of a frame with its pose `share` of the way to the next frame's, as between() has it;
/// after the last frame it goes on as it came, without zooming.
Camera camera_between(std::span<const Camera> cameras,
                      std::size_t frame,
                      double share,
                      bool closed);

/// Adds a picture to a sum, which may have none yet. Throws Error for one of another size.
void add(Image& sum, Image image);
/// The mean of that many.
void divide(Image& sum, int count);

}  // namespace raysplats
