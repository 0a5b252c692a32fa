// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "raysplats/train_options.hpp"

namespace raysplats {

/// Options that are not as usual and that nothing of the run reads, with what does: "prune-scale,
/// split-factor (for strategy = adc), sky-lr (for background = sky)"; empty without any. What a run
/// writes of itself into its configuration is none of them.
std::string unused_options(const TrainOptions& options);

}  // namespace raysplats
