// SPDX-License-Identifier: Apache-2.0
#include "scene/camera/view_axes.hpp"

#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

namespace raysplats {

glm::dvec3 view_axis(const Camera& camera) {
  return glm::transpose(camera.rotation) * glm::dvec3(0.0, 0.0, 1.0);
}

AxesFit fit_axes(std::span<const Camera> cameras) {
  AxesFit fit;
  for (const Camera& camera : cameras) {
    const glm::dvec3 axis = view_axis(camera);
    const glm::dmat3 across = glm::dmat3(1.0) - glm::outerProduct(axis, axis);
    fit.normal += across;
    fit.right += across * camera.center();
  }
  return fit;
}

}  // namespace raysplats
