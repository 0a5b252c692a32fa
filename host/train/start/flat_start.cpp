// SPDX-License-Identifier: Apache-2.0
#include "train/start/flat_start.hpp"

#include <algorithm>
#include <cstddef>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>
#include <limits>

namespace raysplats {
namespace {

constexpr float kAlike = 1e-4f;  // differences of logarithms below which axes are equally long

// The turn that takes the z axis to a unit vector.
glm::dquat turn_to(const glm::dvec3& axis) {
  if (axis.z < -1 + 1e-9) return {0.0, 1.0, 0.0, 0.0};
  return glm::normalize(glm::dquat(1.0 + axis.z, -axis.y, axis.x, 0.0));
}

glm::dvec3 to_nearest(const glm::dvec3& mean, std::span<const Camera> cameras) {
  glm::dvec3 out(0, 0, 1);
  double least = std::numeric_limits<double>::infinity();
  for (const Camera& camera : cameras) {
    const glm::dvec3 to = camera.center() - mean;
    const double length = glm::length(to);
    if (!(length > 0) || length >= least) continue;
    least = length;
    out = to / length;
  }
  return out;
}

}  // namespace

void face_cameras(Gaussians& model, std::span<const Camera> cameras) {
  for (std::size_t i = 0; i < model.size(); ++i) {
    const float* scale = model.log_scales.data() + 3 * i;
    if (*std::max_element(scale, scale + 3) - *std::min_element(scale, scale + 3) >= kAlike)
      continue;
    const float* mean = model.means.data() + 3 * i;
    const glm::dquat turn = turn_to(to_nearest({mean[0], mean[1], mean[2]}, cameras));
    float* q = model.quaternions.data() + 4 * i;
    q[0] = static_cast<float>(turn.w);
    q[1] = static_cast<float>(turn.x);
    q[2] = static_cast<float>(turn.y);
    q[3] = static_cast<float>(turn.z);
  }
}

}  // namespace raysplats
