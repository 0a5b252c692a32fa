// SPDX-License-Identifier: Apache-2.0
#include "train/flat_start.hpp"

#include <algorithm>
#include <cmath>
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

void flatten(Gaussians& model, std::span<const Camera> cameras) {
  for (std::size_t i = 0; i < model.size(); ++i) {
    float* scale = model.log_scales.data() + 3 * i;
    float* q = model.quaternions.data() + 4 * i;
    const std::size_t shortest =
        static_cast<std::size_t>(std::min_element(scale, scale + 3) - scale);
    const glm::dquat before(q[0], q[1], q[2], q[3]);
    glm::dquat after = before;
    if (*std::max_element(scale, scale + 3) - scale[shortest] < kAlike) {
      const float* mean = model.means.data() + 3 * i;
      after = turn_to(to_nearest({mean[0], mean[1], mean[2]}, cameras));
    } else if (shortest != 2) {
      // A third of a turn about the diagonal: the axes change places in a ring.
      const double sense = shortest == 0 ? 0.5 : -0.5;
      after = before * glm::dquat(0.5, sense, sense, sense);
      std::rotate(scale, scale + shortest + 1, scale + 3);
    }
    scale[2] = std::min(scale[0], scale[1]) + static_cast<float>(std::log(kFlatness));
    q[0] = static_cast<float>(after.w);
    q[1] = static_cast<float>(after.x);
    q[2] = static_cast<float>(after.y);
    q[3] = static_cast<float>(after.z);
  }
}

}  // namespace raysplats
