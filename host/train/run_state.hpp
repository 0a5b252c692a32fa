// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "device/context.hpp"
#include "raysplats/train_options.hpp"
#include "run/checkpoint.hpp"
#include "trace/device_gaussians.hpp"
#include "train/adam.hpp"
#include "train/density_control.hpp"

namespace raysplats {

/// Copies parameters, Adam's moments and the density statistics into a checkpoint; waits for the
/// device.
void store_state(const DeviceGaussians& gaussians,
                 const Adam& adam,
                 const DensityControl& density,
                 Checkpoint& checkpoint);

/// The way back. Throws UsageError when the checkpoint was made with another SH degree or scale
/// activation than the options say, DataError when its arrays do not fit its counts.
void restore_state(Context& context,
                   const Checkpoint& checkpoint,
                   const TrainOptions& options,
                   DeviceGaussians& gaussians,
                   Adam& adam,
                   DensityControl& density);

}  // namespace raysplats
