// SPDX-License-Identifier: Apache-2.0
#include "io/model/float_blur.hpp"

#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "scene/statistics.hpp"

namespace raysplats::io {
namespace {

constexpr double kRounding = 0x1p-24;  // of a number in single precision
constexpr double kUnseenShare = 0.01;  // of a size

}  // namespace

double blur_at(const glm::dvec3& place) { return kRounding * glm::length(place); }

double unseen_blur(double size) { return kUnseenShare * size; }

void GaussianPlaces::reserve(std::size_t count) {
  positions_.reserve(3 * count);
  log_sizes_.reserve(count);
}

void GaussianPlaces::add(const glm::dvec3& position, double log_size) {
  for (int k = 0; k < 3; ++k) positions_.push_back(position[k]);
  log_sizes_.push_back(log_size);
}

glm::dvec3 GaussianPlaces::median_position() const {
  glm::dvec3 center(0.0);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    std::vector<double> values;
    for (std::size_t i = axis; i < positions_.size(); i += 3) values.push_back(positions_[i]);
    center[static_cast<int>(axis)] = median(std::move(values));
  }
  return center;
}

double GaussianPlaces::median_size() const { return std::exp(median(log_sizes_)); }

}  // namespace raysplats::io
