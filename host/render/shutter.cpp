// SPDX-License-Identifier: Apache-2.0
#include "render/shutter.hpp"

#include <fmt/format.h>

#include <utility>

#include "raysplats/error.hpp"
#include "scene/camera/camera_path.hpp"

namespace raysplats {

void check_shutter(const FrameOptions& options) {
  if (options.shutter_samples < 1 || !(options.shutter > 0.0 && options.shutter <= 1.0)) {
    throw UsageError(fmt::format(
        "--shutter-samples {} over --shutter {} are no motion blur: use 1 or more, over 0 to 1",
        options.shutter_samples, options.shutter));
  }
}

double moment(const FrameOptions& options, int k) {
  return options.shutter * k / options.shutter_samples;
}

Camera camera_between(std::span<const Camera> cameras,
                      std::size_t frame,
                      double share,
                      bool closed) {
  const Camera& now = cameras[frame];
  if (share == 0.0 || cameras.size() < 2) return now;
  if (frame + 1 < cameras.size()) return between(now, cameras[frame + 1], share);
  if (closed) return between(now, cameras.front(), share);
  // On as it came.
  return between(now, cameras[frame - 1], -share);
}

void add(Image& sum, Image image) {
  if (sum.data.empty()) {
    sum = std::move(image);
    return;
  }
  if (image.width != sum.width || image.height != sum.height || image.channels != sum.channels)
    throw Error(ErrorCode::kRuntime, "Moments of a frame are pictures of different sizes");
  for (std::size_t i = 0; i < sum.data.size(); ++i) sum.data[i] += image.data[i];
}

void divide(Image& sum, int count) {
  const float scale = 1.0f / static_cast<float>(count);
  for (float& value : sum.data) value *= scale;
}

}  // namespace raysplats
