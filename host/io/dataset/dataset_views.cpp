// SPDX-License-Identifier: Apache-2.0
#include "io/dataset/dataset_views.hpp"

namespace raysplats {

std::vector<Camera> cameras_of(const Dataset& dataset, std::span<const std::size_t> views) {
  std::vector<Camera> cameras;
  cameras.reserve(views.size());
  for (const std::size_t view : views) cameras.push_back(dataset.views[view].camera);
  return cameras;
}

std::vector<Camera> cameras_of(const Dataset& dataset, Split split) {
  return cameras_of(dataset, dataset.indices(split));
}

}  // namespace raysplats
