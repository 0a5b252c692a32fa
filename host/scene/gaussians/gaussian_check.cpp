// SPDX-License-Identifier: Apache-2.0
#include "scene/gaussians/gaussian_check.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

void check_size(const char* name, const std::vector<float>& values, std::size_t expected) {
  if (values.size() == expected) return;
  throw UsageError(fmt::format(
      "The Gaussians have {} numbers of {} where {} are needed: give every array its size",
      values.size(), name, expected));
}

void check_finite(const char* name, const std::vector<float>& values, std::size_t gaussians) {
  const auto bad =
      std::find_if(values.begin(), values.end(), [](float value) { return !std::isfinite(value); });
  if (bad == values.end()) return;
  const auto number = static_cast<std::size_t>(bad - values.begin());
  throw DataError(
      fmt::format("Gaussian {} has a number of '{}' that is not finite: remove or mend it",
                  number / (values.size() / gaussians), name));
}

// Kernels normalise rotations in single precision, where squares have to be numbers.
void check_lengths(const std::vector<float>& quaternions) {
  for (std::size_t i = 0; i < quaternions.size(); i += 4) {
    double squares = 0;
    for (std::size_t k = i; k < i + 4; ++k) {
      const double part = quaternions[k];
      squares += part * part;
    }
    const double length = std::sqrt(squares);
    if (length >= kShortestQuaternion && length <= kLongestQuaternion) continue;
    throw DataError(
        fmt::format("The quaternion of Gaussian {} has the length {:.3g}, which is no rotation: "
                    "normalise it, (1, 0, 0, 0) being none",
                    i / 4, length));
  }
}

}  // namespace

void check_sh_degree(int degree) {
  if (degree >= 0 && degree <= kMaxShDegree) return;
  throw UsageError(
      fmt::format("The Gaussians have SH degree {}: 0 to {} are possible", degree, kMaxShDegree));
}

void check_sizes(const Gaussians& gaussians) {
  check_sh_degree(gaussians.sh_degree);
  const std::size_t n = gaussians.size();
  check_size("means", gaussians.means, 3 * n);
  check_size("quaternions", gaussians.quaternions, 4 * n);
  check_size("log_scales", gaussians.log_scales, 3 * n);
  check_size("opacities", gaussians.opacities, n);
  check_size("sh", gaussians.sh,
             3 * n * static_cast<std::size_t>(sh_coefficients(gaussians.sh_degree)));
}

void check_gaussians(const Gaussians& gaussians) {
  check_sizes(gaussians);
  check_finite("means", gaussians.means, gaussians.size());
  check_finite("quaternions", gaussians.quaternions, gaussians.size());
  check_finite("log_scales", gaussians.log_scales, gaussians.size());
  check_finite("opacities", gaussians.opacities, gaussians.size());
  check_finite("sh", gaussians.sh, gaussians.size());
  check_lengths(gaussians.quaternions);
}

}  // namespace raysplats
