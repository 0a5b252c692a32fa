// SPDX-License-Identifier: Apache-2.0
#include "train/start/point_cloud.hpp"

namespace raysplats {

void append_point(PointCloud& to, const glm::dvec3& position, const glm::dvec3& color) {
  for (int a = 0; a < 3; ++a) {
    to.positions.push_back(static_cast<float>(position[a]));
    to.colors.push_back(static_cast<float>(color[a]));
  }
}

void append_point(const PointCloud& from, std::size_t i, PointCloud& to) {
  for (std::size_t k = 3 * i; k < 3 * i + 3; ++k) {
    to.positions.push_back(from.positions[k]);
    to.colors.push_back(from.colors[k]);
  }
}

}  // namespace raysplats
