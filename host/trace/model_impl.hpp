// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "raysplats/model.hpp"
#include "trace/device_gaussians.hpp"

namespace raysplats {

struct Model::Impl {
  Context& context;
  DeviceGaussians gaussians;
};

/// Throws UsageError when the arrays do not fit each other or the SH degree is not 0 to 4,
/// DataError when a number is not finite.
void check_gaussians(const Gaussians& gaussians);

/// The model's parameters on the device. Throws UsageError when the model is of another context.
const DeviceGaussians& gaussians_of(const Model& model, const Context& context);

}  // namespace raysplats
