// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

#include "raysplats/trace_options.hpp"
#include "raysplats/train_options.hpp"
#include "train/optimizer/adam.hpp"

namespace raysplats {

/// What the parts of a step take of a run's options; `background` as background_color() says.
TraceOptions trace_options_of(const TrainOptions& options, const std::array<float, 3>& background);
AdamOptions adam_options_of(const TrainOptions& options);
/// Learning rates of the step after `iteration` completed ones; `extent` as scene_extent() says,
/// `motion` as motion_extent().
AdamRates adam_rates_of(const TrainOptions& options,
                        double extent,
                        double motion,
                        std::int64_t iteration);

}  // namespace raysplats
