// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "raysplats/model.hpp"
#include "trace/device_gaussians.hpp"

namespace raysplats {

struct Model::Impl {
  Context& context;
  DeviceGaussians gaussians;
};

/// The model's parameters on the device. Throws UsageError when the model is of another context.
const DeviceGaussians& gaussians_of(const Model& model, const Context& context);

}  // namespace raysplats
