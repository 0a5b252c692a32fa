// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <vector>

namespace raysplats::io {

/// How far single precision shifts what lies there.
double blur_at(const glm::dvec3& place);

/// How far a detail of this size may be shifted without being seen.
double unseen_blur(double size);

/// Where Gaussians lie and how large they are, which says whether single precision blurs them.
class GaussianPlaces {
 public:
  void reserve(std::size_t count);
  /// `log_size`: the logarithm of the longest axis.
  void add(const glm::dvec3& position, double log_size);

  /// x, y, z each.
  const std::vector<double>& positions() const { return positions_; }
  /// The medians of x, of y and of z; 0 for none.
  glm::dvec3 median_position() const;
  double median_size() const;

 private:
  std::vector<double> positions_, log_sizes_;
};

}  // namespace raysplats::io
