// SPDX-License-Identifier: Apache-2.0
#include "scene/image/pixel_places.hpp"

#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/matrix_transform.hpp>
#include <numbers>
#include <numeric>

#include "shared/random.h"

namespace raysplats {
namespace {

// The number nearest to the golden section of `samples` that has no factor in common with it.
std::uint64_t lattice_step(std::uint64_t samples) {
  const auto middle =
      static_cast<std::uint64_t>(std::llround(static_cast<double>(samples) / std::numbers::phi));
  for (std::uint64_t away = 0;; ++away) {
    if (std::gcd(middle + away, samples) == 1) return middle + away;
    if (away < middle && std::gcd(middle - away, samples) == 1) return middle - away;
  }
}

// The shift of all pixels' places, from random numbers that no pixel has.
glm::dvec3 shift_of(std::uint64_t seed) {
  if (seed == 0) return glm::dvec3(0.0);
  const RsRandom4 random = rs_random4(static_cast<rs_uint>(seed), static_cast<rs_uint>(seed >> 32),
                                      UINT32_MAX, UINT32_MAX, UINT32_MAX);
  return {random.x, random.y, random.z};
}

}  // namespace

glm::dvec3 pixel_place(std::uint64_t sample, std::uint64_t samples, std::uint64_t seed) {
  if (samples <= 1) return glm::dvec3(0.0);
  const std::uint64_t step = lattice_step(samples);
  const std::array<std::uint64_t, 3> parts{sample, sample * step % samples,
                                           sample * step % samples * step % samples};
  glm::dvec3 out = shift_of(seed);
  for (int k = 0; k < 3; ++k) {
    out[k] += (static_cast<double>(parts[static_cast<std::size_t>(k)]) + 0.5) /
              static_cast<double>(samples);
    out[k] -= std::floor(out[k]) + 0.5;
  }
  return out;
}

Camera moved_in_pixels(Camera camera, const glm::dvec3& place) {
  if (place == glm::dvec3(0.0)) return camera;
  if (camera.model == CameraModel::kEquirectangular) {
    const double angle = std::numbers::pi / camera.height * glm::length(place);
    const glm::dmat3 turn(glm::rotate(glm::dmat4(1.0), angle, glm::normalize(place)));
    camera.rotation = turn * camera.rotation;
    camera.translation = turn * camera.translation;
  } else {
    camera.cx -= place.x;
    camera.cy -= place.y;
  }
  return camera;
}

}  // namespace raysplats
