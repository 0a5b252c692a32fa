// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "shared/layout.h"

namespace raysplats {

/// Boxes of the confidence ellipsoids of Gaussians, for Lbvh: half-width sqrt(Q Sigma_jj) along
/// axis j with Sigma = R S S R^T (Byrski et al. 2025, eq. 2), grown a little so that float rounding
/// never loses a hit.
class GaussianBounds {
 public:
  /// `sigmoid_scale`: S = sigmoid(s), else exp(s). `adaptive_radius`: Q_i = min(Q, 2 ln(255
  /// sigmoid(opacity))), and an empty box where sigmoid(opacity) < 1/255.
  GaussianBounds(Context& context, bool sigmoid_scale, bool adaptive_radius);

  /// Writes boxes[0..count), growing the buffer when it is smaller. Parameters are before
  /// activation, Gaussian-major: means 3 N, quaternions 4 N (r, i, j, k; any length but 0), scales
  /// 3 N, opacities N. A Gaussian with a NaN or an infinity or without a rotation gets an empty
  /// box. Throws UsageError when a buffer is too short.
  void compute(const Buffer<float>& means,
               const Buffer<float>& quaternions,
               const Buffer<float>& scales,
               const Buffer<float>& opacities,
               std::size_t count,
               float quantile,
               Buffer<RsAabb>& boxes);

 private:
  Context* context_;
  std::size_t chunk_;  // Gaussians per work-item
  Kernel kernel_;
};

}  // namespace raysplats
