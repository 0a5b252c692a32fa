// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "bvh/gaussian_bounds.hpp"
#include "bvh/lbvh.hpp"
#include "device/context.hpp"
#include "raysplats/trace_options.hpp"
#include "trace/device_gaussians.hpp"
#include "train/adam.hpp"

namespace raysplats {

/// Looks for what must never be in a model under training: parameters or moments of the optimiser
/// that are not finite, and boxes or a tree over them that break their invariants. For finding
/// faults of devices, drivers and kernels: it reads the tree back, so it is slow.
class ModelValidator {
 public:
  ModelValidator(Context& context, ScaleActivation activation, const TraceOptions& options);

  /// "" or one sentence about the first fault: which array, which Gaussian, how many.
  std::string find_fault(const DeviceGaussians& gaussians, const Adam& adam);

 private:
  std::string find_non_finite(const Buffer<float>& values,
                              const std::string& name,
                              std::size_t width);
  std::string check_boxes(const DeviceGaussians& gaussians);

  Context& context_;
  float quantile_;
  std::size_t chunk_;  // Gaussians per work-item
  Kernel kernel_;
  GaussianBounds bounds_;
  Lbvh tree_;
  Buffer<std::uint32_t> found_;
  Buffer<RsAabb> boxes_;
};

}  // namespace raysplats
