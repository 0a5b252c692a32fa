// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "device/context.hpp"
#include "raysplats/camera.hpp"
#include "shared/layout.h"
#include "trace/device_gaussians.hpp"

namespace raysplats {

/// Limits of all standard deviations, world units; 0 = none.
struct ScaleLimits {
  double least = 0, greatest = 0;
};

/// Keeps Gaussians from becoming thinner than a share of a pixel in the view that resolves them
/// best, and within fixed limits: see cl/train/footprint.cl. What it changes are the parameters
/// themselves, so the model that is written needs nothing else to look as it did in training.
class Footprint {
 public:
  /// `share` of a pixel as a standard deviation; 0 = without.
  Footprint(Context& context,
            std::span<const Camera> cameras,
            double share,
            const ScaleLimits& limits = {});

  /// Finds the least sizes for the Gaussians' present means; enqueues without waiting.
  void update(const DeviceGaussians& gaussians);

  /// The least scale parameters found last, for checkpoints; empty without a share.
  const Buffer<float>& lows() const { return lows_; }
  /// Puts them back: what a resumed run does until its next update() depends on them.
  void restore(std::span<const float> lows);

  /// Raises what is smaller and keeps to the limits; update() has to have seen this number of
  /// Gaussians. Below 1 (ScaleActivation::kExp), `thickness` then is what the shortest axis may
  /// have of the next one, however thin that makes it. A guard whose first word is not 0 keeps
  /// Gaussians as they are.
  void apply(DeviceGaussians& gaussians, const Buffer<std::uint32_t>& guard, double thickness = 1);

 private:
  void raise(DeviceGaussians& gaussians, const Buffer<std::uint32_t>& guard);

  Context& context_;
  double share_;
  ScaleLimits limits_;
  std::uint32_t views_ = 0;
  Buffer<RsFootprintView> cameras_;
  Buffer<float> lows_;
};

/// How large the pixels of a camera are, for the device.
RsFootprintView footprint_view(const Camera& camera);

}  // namespace raysplats
