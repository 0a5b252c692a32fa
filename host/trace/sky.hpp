// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "device/buffer.hpp"
#include "device/context.hpp"
#include "raysplats/camera.hpp"
#include "raysplats/trace_options.hpp"

namespace raysplats {

/// Light behind the Gaussians of a view that depends on the direction alone, forward and backward
/// (cl/trace/sky.cl). Sums are taken in a fixed order: equal inputs give equal bits.
class Sky {
 public:
  /// Throws UsageError for coefficients that are not those of degree 0 to 4, or not finite.
  Sky(Context& context, const SkyLight& light);

  /// Puts it behind a view over black: planar R, G, B, A; R, G, B are changed.
  void show(const Camera& camera, const Buffer<float>& image);
  /// Turns the gradient of the last show()'s result (planar dL/dR, dL/dG, dL/dB, dL/dA) into that
  /// of the view over black, valid until the next call, and gradient().
  const Buffer<float>& backward(const Camera& camera,
                                const Buffer<float>& image,
                                const Buffer<float>& image_gradient);

  /// 3 numbers a coefficient, as in TraceOptions::sky; may be changed between views.
  const Buffer<float>& coefficients() const { return coefficients_; }
  /// Throws UsageError for another number of them; blocks.
  void set(std::span<const float> coefficients);
  /// Gradient of the coefficients of the last backward(), in the same order.
  const Buffer<float>& gradient() const { return gradient_; }
  /// The present coefficients and that gradient on the host; both block.
  SkyLight light() const;
  SkyLight download_gradient() const;

 private:
  Kernel kernel(const char* name, const Camera& camera) const;

  Context& context_;
  int degree_;
  Buffer<float> coefficients_, gradient_, partials_, image_gradient_;
};

/// Throws UsageError as Sky does.
void check_sky(const SkyLight& light);
/// Throws UsageError for a colour behind everything that is not finite.
void check_background(const std::array<float, 3>& background);

}  // namespace raysplats
