// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>

#include "scene/gaussians/activation.hpp"
#include "shared/sh.h"

/// How the numbers of a Gaussian are coded in files other than PLY.
namespace raysplats::io {

/// The value of the constant spherical harmonic.
constexpr double kSh0 = RS_SH0;

/// Opacities are kept this far from 0 and 1, where the logit is infinite; those of bytes too, whose
/// ends stand for whole ones.
constexpr double kOpacityMargin = 1e-7;

/// Logarithm of the scale that a flat axis, of size 0 in its file, gets.
constexpr float kFlatLogScale = -20.0f;
/// Of an axis as long as formats that have sizes in place of logarithms can hold, and viewers
/// square.
constexpr float kMostLogScale = 40.0f;

inline double opacity_of(float logit) { return sigmoid(static_cast<double>(logit)); }

inline float logit_of(double opacity) {
  return static_cast<float>(logit(std::clamp(opacity, kOpacityMargin, 1.0 - kOpacityMargin)));
}

/// The nearest of 0..255.
inline std::uint8_t to_byte(double value) {
  return static_cast<std::uint8_t>(std::clamp(std::floor(value + 0.5), 0.0, 255.0));
}

/// Length 1 and real part first; what has no direction is not rotated.
inline std::array<double, 4> unit_quaternion(const float* q) {
  std::array<double, 4> out{};
  double norm = 0.0;
  for (std::size_t c = 0; c < 4; ++c) {
    out[c] = static_cast<double>(q[c]);
    norm += out[c] * out[c];
  }
  if (!(norm > 0.0)) return {1.0, 0.0, 0.0, 0.0};
  for (double& value : out) value /= std::sqrt(norm);
  return out;
}

}  // namespace raysplats::io
