// SPDX-License-Identifier: Apache-2.0
#include "reference/optics.hpp"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace raysplats::reference {

glm::dvec3 reflected(const glm::dvec3& d, const glm::dvec3& n) {
  return d - 2.0 * glm::dot(d, n) * n;
}

std::optional<glm::dvec3> refracted(const glm::dvec3& d,
                                    const glm::dvec3& n,
                                    double n1,
                                    double n2) {
  // The part along the surface scales by n1 / n2, the rest follows from the unit length.
  const glm::dvec3 along = (n1 / n2) * (d - glm::dot(d, n) * n);
  const double rest = 1.0 - glm::dot(along, along);
  if (rest < 0.0) return std::nullopt;
  return along - std::sqrt(rest) * n;
}

double fresnel(double cosine, double n1, double n2) {
  const double sine = n1 / n2 * std::sqrt(std::max(0.0, 1.0 - cosine * cosine));
  if (sine >= 1.0) return 1.0;
  const double transmitted = std::sqrt(1.0 - sine * sine);
  const double s = (n1 * cosine - n2 * transmitted) / (n1 * cosine + n2 * transmitted);
  const double p = (n1 * transmitted - n2 * cosine) / (n1 * transmitted + n2 * cosine);
  return 0.5 * (s * s + p * p);
}

}  // namespace raysplats::reference
