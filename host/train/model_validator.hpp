// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

#include "device/context.hpp"
#include "raysplats/trace_options.hpp"
#include "trace/device_gaussians.hpp"
#include "trace/ray_tracer.hpp"
#include "trace/ray_tree.hpp"
#include "train/optimizer/adam.hpp"

namespace raysplats {

/// Looks for what must never be in a model under training: parameters or moments of the optimiser
/// that are not finite, and boxes or the tree that rays walk breaking their invariants. For finding
/// faults of devices, drivers and kernels: it reads the tree back, so it is slow.
class ModelValidator {
 public:
  ModelValidator(Context& context, const TraceOptions& options);

  /// "" or one sentence about the first fault: which array, which Gaussian, how many. The tree is
  /// the one that `rays` walk, brought up to date as before the next view; null: one of its own,
  /// made the same way.
  std::string find_fault(const DeviceGaussians& gaussians,
                         const Adam& adam,
                         RayTracer* rays = nullptr);

 private:
  // `width` numbers of each of `count` Gaussians, from number `first` of a buffer on.
  struct Numbers {
    const Buffer<float>* buffer;
    std::size_t first, count, width;
  };
  std::string find_non_finite(const Numbers& numbers, const std::string& name);

  Context& context_;
  std::size_t chunk_;  // Gaussians per work-item
  Kernel kernel_;
  RayTree tree_;  // its own: refitted or built from one call to the next, as in training
  Buffer<std::uint32_t> found_;
};

}  // namespace raysplats
