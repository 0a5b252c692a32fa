// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "device/context.hpp"
#include "raysplats/train_options.hpp"
#include "run/checkpoint.hpp"
#include "trace/device_gaussians.hpp"
#include "train/density/density_control.hpp"
#include "train/optimizer/adam.hpp"
#include "train/optimizer/parameter_mean.hpp"

namespace raysplats {

/// Puts what is known of them into a checkpoint, and returns parameters, Adam's moments and the
/// density statistics as its sections, which copy them from the device when they are asked for.
CheckpointSections store_state(const DeviceGaussians& gaussians,
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

/// The same of the mean of the parameters, if there is one.
CheckpointSections store_mean(const ParameterMean& mean, Checkpoint& checkpoint);
/// Checkpoints of versions without one leave it unknown. `gaussians` are restored. Throws DataError
/// when arrays do not fit the counts.
void restore_mean(const Checkpoint& checkpoint,
                  const TrainOptions& options,
                  const DeviceGaussians& gaussians,
                  ParameterMean& mean);

}  // namespace raysplats
