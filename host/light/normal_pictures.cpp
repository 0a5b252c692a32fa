// SPDX-License-Identifier: Apache-2.0
#include "light/normal_pictures.hpp"

#include <array>

#include "device/build_options.hpp"
#include "device/kernel.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kGroup = 64;

TraceOptions normal_options(TraceOptions options) {
  options.background = {0.0f, 0.0f, 0.0f};
  options.sky.clear();
  options.depth = false;
  return options;
}

/// Where a camera looks from; the fourth number is 0 for a direction in which it looks instead.
std::array<float, 4> eye_of(const Camera& camera) {
  std::array<float, 4> eye{};
  const bool parallel = camera.model == CameraModel::kOrthographic;
  const glm::dvec3 center = camera.center();
  for (int k = 0; k < 3; ++k) {
    eye[static_cast<std::size_t>(k)] =
        static_cast<float>(parallel ? camera.rotation[k][2] : center[k]);
  }
  eye[3] = parallel ? 0.0f : 1.0f;
  return eye;
}

void copy(Context& context, const Buffer<float>& from, Buffer<float>& to, const char* label) {
  to.ensure(context, from.size(), label);
  to.copy_from(from, from.size());
}

}  // namespace

NormalPictures::NormalPictures(Context& context, const TraceOptions& options)
    : context_(context),
      kernel_(context.kernel("light/normal_pictures.cl", "gaussian_normals")),
      views_(context, normal_options(options)) {}

void NormalPictures::follow(const DeviceGaussians& gaussians) {
  if (revision_ == gaussians.revision) return;
  copy_.count = gaussians.count;
  copy_.activation = gaussians.activation;
  copy(context_, gaussians.means, copy_.means, "means of normals");
  copy(context_, gaussians.quaternions, copy_.quaternions, "quaternions of normals");
  copy(context_, gaussians.scales, copy_.scales, "scales of normals");
  copy(context_, gaussians.opacities, copy_.opacities, "opacities of normals");
  copy_.sh.ensure(context_, 3 * gaussians.count, "normals");
  revision_ = gaussians.revision;
}

Image NormalPictures::draw(const DeviceGaussians& gaussians,
                           const Camera& camera,
                           const std::function<bool(double)>& watch) {
  follow(gaussians);
  if (copy_.count > 0) {
    kernel_.launch(Range::linear(copy_.count, kGroup), copy_.means, copy_.quaternions, copy_.scales,
                   eye_of(camera), static_cast<std::uint32_t>(copy_.count), copy_.sh);
  }
  copy_.changed(context_);
  views_.set_watch(watch);
  views_.forward(copy_, camera);
  const Image colors = views_.download_image();
  Image out(camera.width, camera.height, 3);
  for (std::size_t i = 0; i < out.pixels(); ++i) {
    const float* pixel = &colors.data[4 * i];
    for (std::size_t c = 0; c < 3; ++c) out.data[3 * i + c] = 2.0f * pixel[c] - pixel[3];
  }
  return out;
}

}  // namespace raysplats
