// SPDX-License-Identifier: Apache-2.0
#include "scene/gaussians/model_changes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <glm/trigonometric.hpp>
#include <numbers>
#include <utility>
#include <vector>

#include "raysplats/error.hpp"
#include "raysplats/gaussians.hpp"
#include "scene/gaussians/gaussian_check.hpp"
#include "scene/gaussians/gaussian_selection.hpp"
#include "scene/gaussians/gaussian_transform.hpp"

namespace raysplats {
namespace {

constexpr double kLeastScale = 1e-30, kMostScale = 1e30;  // beyond, 32-bit positions are 0 or none

/// The shortest turn of `up` to -y.
glm::dmat4 uprighting(const glm::dvec3& up) {
  // Divided first, as squares of small and large numbers leave those that a double holds.
  const double largest = std::max({std::abs(up.x), std::abs(up.y), std::abs(up.z)});
  const glm::dvec3 from = glm::normalize(up / largest);
  if (!std::isfinite(from.x + from.y + from.z)) {
    throw UsageError(
        fmt::format("up {},{},{} is no direction: say which one is to be up", up.x, up.y, up.z));
  }
  const glm::dvec3 goal(0.0, -1.0, 0.0);
  const glm::dvec3 axis = glm::cross(from, goal);
  const double sine = glm::length(axis);
  const double cosine = glm::dot(from, goal);
  // Half a turn goes about x: left and right change places with no other axis than front and back.
  if (sine < 1e-9) {
    return cosine > 0.0 ? glm::dmat4(1.0)
                        : glm::rotate(glm::dmat4(1.0), std::numbers::pi, glm::dvec3(1, 0, 0));
  }
  return glm::rotate(glm::dmat4(1.0), std::atan2(sine, cosine), axis / sine);
}

void check_box(const Bounds& box) {
  for (std::size_t i = 0; i < 3; ++i) {
    if (box.low[i] <= box.high[i]) continue;
    throw UsageError(fmt::format(
        "The box to crop to has no inside: its least {} is {} and its greatest {}: swap "
        "them, as in least x,y,z and then greatest x,y,z",
        "xyz"[i], box.low[i], box.high[i]));
  }
}

}  // namespace

glm::dmat4 movement(const ModelChanges& changes) {
  if (!(changes.scale > 0.0))
    throw UsageError(fmt::format("scale is above 0, not {}", changes.scale));
  if (changes.scale < kLeastScale || changes.scale > kMostScale) {
    throw UsageError(
        fmt::format("scale is {} to {}, not {}", kLeastScale, kMostScale, changes.scale));
  }
  glm::dmat4 map = glm::translate(glm::dmat4(1.0), changes.translate);
  map = glm::rotate(map, glm::radians(changes.rotate_degrees.z), glm::dvec3(0, 0, 1));
  map = glm::rotate(map, glm::radians(changes.rotate_degrees.y), glm::dvec3(0, 1, 0));
  map = glm::rotate(map, glm::radians(changes.rotate_degrees.x), glm::dvec3(1, 0, 0));
  map = glm::scale(map, glm::dvec3(changes.scale));
  return changes.up ? map * uprighting(*changes.up) : map;
}

Gaussians changed(Gaussians model, const ModelChanges& changes) {
  check_sizes(model);
  if (changes.min_opacity && !(*changes.min_opacity >= 0.0 && *changes.min_opacity <= 1.0))
    throw UsageError(fmt::format("min-opacity is 0 to 1, not {}", *changes.min_opacity));
  if (changes.sh_degree && (*changes.sh_degree < 0 || *changes.sh_degree > kMaxShDegree))
    throw UsageError(fmt::format("sh-degree is 0 to {}, not {}", kMaxShDegree, *changes.sh_degree));
  if (changes.crop) check_box(*changes.crop);
  std::vector<double> weights = changes.contributions;
  if (!weights.empty() && weights.size() != model.size()) {
    throw UsageError(fmt::format("There are {} contributions of {} Gaussians: give one of each",
                                 weights.size(), model.size()));
  }
  const auto keep = [&](const std::vector<std::uint32_t>& indices) {
    if (indices.size() == model.size()) return;
    model = gathered(model, indices);
    if (weights.empty()) return;
    for (std::size_t i = 0; i < indices.size(); ++i) weights[i] = weights[indices[i]];
    weights.resize(indices.size());
  };
  if (changes.min_opacity) keep(with_opacity(model, *changes.min_opacity));
  const glm::dmat4 map = movement(changes);
  if (map != glm::dmat4(1.0)) model = transformed(std::move(model), map);
  if (changes.crop) keep(within(model, *changes.crop));
  if (changes.max_gaussians)
    keep(largest(weights.empty() ? sections(model) : weights, *changes.max_gaussians));
  if (changes.sh_degree) model = with_sh_degree(model, *changes.sh_degree);
  return model;
}

}  // namespace raysplats
