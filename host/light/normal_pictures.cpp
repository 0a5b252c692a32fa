// SPDX-License-Identifier: Apache-2.0
#include "light/normal_pictures.hpp"

namespace raysplats {
namespace {

TraceOptions normal_options(TraceOptions options) {
  options.background = {0.0f, 0.0f, 0.0f};
  options.sky.clear();
  options.depth = false;
  return options;
}

}  // namespace

NormalPictures::NormalPictures(Context& context, const TraceOptions& options)
    : normals_(context), views_(context, normal_options(options)) {}

Image NormalPictures::draw(const DeviceGaussians& gaussians,
                           const Camera& camera,
                           const std::function<bool(double)>& watch) {
  views_.set_watch(watch);
  views_.forward(normals_.of(gaussians, camera), camera);
  const Image colors = views_.download_image();
  Image out(camera.width, camera.height, 3);
  for (std::size_t i = 0; i < out.pixels(); ++i) {
    const float* pixel = &colors.data[4 * i];
    for (std::size_t c = 0; c < 3; ++c) out.data[3 * i + c] = 2.0f * pixel[c] - pixel[3];
  }
  return out;
}

}  // namespace raysplats
