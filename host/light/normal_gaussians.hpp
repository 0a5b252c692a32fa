// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "device/context.hpp"
#include "device/kernel.hpp"
#include "raysplats/camera.hpp"
#include "trace/device_gaussians.hpp"

namespace raysplats {

/// A copy of Gaussians without their colours, 56 bytes each, in whose place it has their normals as
/// a camera sees them: 0.5 + 0.5 n, world axes.
class NormalGaussians {
 public:
  explicit NormalGaussians(Context& context);

  /// Until the next call; with a new revision where the camera stands elsewhere than in the last
  /// one, or the Gaussians are others.
  const DeviceGaussians& of(const DeviceGaussians& gaussians, const Camera& camera);

 private:
  /// Copies Gaussians that changed.
  void follow(const DeviceGaussians& gaussians);

  Context& context_;
  Kernel kernel_;
  DeviceGaussians copy_;
  std::uint64_t revision_ = 0;               // of the Gaussians that were copied
  std::optional<std::array<float, 4>> eye_;  // that the normals look at; none are made yet without
};

}  // namespace raysplats
