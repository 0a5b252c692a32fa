// SPDX-License-Identifier: Apache-2.0
#include "light/normal_gaussians.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kGroup = 64;

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

NormalGaussians::NormalGaussians(Context& context)
    : context_(context), kernel_(context.kernel("light/normal_gaussians.cl", "gaussian_normals")) {}

void NormalGaussians::follow(const DeviceGaussians& gaussians) {
  if (revision_ == gaussians.revision) return;
  // Where this throws, the copy is of nothing.
  revision_ = 0;
  eye_.reset();
  copy_.count = gaussians.count;
  copy_.activation = gaussians.activation;
  copy(context_, gaussians.means, copy_.means, "means of normals");
  copy(context_, gaussians.quaternions, copy_.quaternions, "quaternions of normals");
  copy(context_, gaussians.scales, copy_.scales, "scales of normals");
  copy(context_, gaussians.opacities, copy_.opacities, "opacities of normals");
  copy_.sh.ensure(context_, 3 * gaussians.count, "normals");
  revision_ = gaussians.revision;
}

const DeviceGaussians& NormalGaussians::of(const DeviceGaussians& gaussians, const Camera& camera) {
  const std::array<float, 4> eye = eye_of(camera);
  follow(gaussians);
  if (eye_ == eye) return copy_;
  if (copy_.count > 0) {
    kernel_.launch(Range::linear(copy_.count, kGroup), copy_.means, copy_.quaternions, copy_.scales,
                   eye, static_cast<std::uint32_t>(copy_.count), copy_.sh);
  }
  copy_.changed(context_);
  eye_ = eye;
  return copy_;
}

}  // namespace raysplats
