// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "device/context.hpp"
#include "trace/device_gaussians.hpp"

namespace raysplats {

/// What the views of a step say together: the gradient of every parameter of the Gaussians, and of
/// a sky where there is one.
struct StepGradients {
  GaussianGradients gaussians;
  Buffer<float> sky;  ///< empty without one
};

/// Sum of the gradients of a step's views in a fixed tree over their slots: neighbours first, then
/// neighbouring sums, ((0 + 1) + (2 + 3)) + ((4 + 5) + 6) for seven. So the sum is a function of
/// the slots alone, whoever finds their gradients and when; what is kept at once is a set for every
/// level. GaussianGradients::screen is added too: its last number tells how many views met a
/// Gaussian then.
class GradientTree {
 public:
  explicit GradientTree(Context& context) : context_(context) {}

  /// Forgets what was added: a step that broke off.
  void clear();
  /// Takes the gradients of the next slot, and leaves buffers of an earlier one in their place.
  /// Enqueues without waiting.
  void add(StepGradients& slot);
  /// Moves the sum of all slots since the last finish() to `sum`. Throws UsageError without any.
  void finish(StepGradients& sum);

 private:
  struct Level {
    StepGradients gradients;
    bool full = false;
  };
  void join(const StepGradients& earlier, StepGradients& later);

  Context& context_;
  std::vector<Level> levels_;
};

}  // namespace raysplats
