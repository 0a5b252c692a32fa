// SPDX-License-Identifier: Apache-2.0
#include "train/step_options.hpp"

#include "train/optimizer/sky_adam.hpp"
#include "train/schedule.hpp"

namespace raysplats {

TraceOptions trace_options_of(const TrainOptions& options, const std::array<float, 3>& background) {
  TraceOptions trace = options.trace;
  trace.background = background;
  trace.raise_clamped = options.raise_clamped;
  trace.least_weight = static_cast<float>(options.prune_weight);
  trace.sky.clear();
  trace.depth = options.depth_weight > 0;
  if (options.background == "sky") trace.sky = even_sky(options.sky_degree, background);
  return trace;
}

AdamOptions adam_options_of(const TrainOptions& options) {
  AdamOptions adam;
  adam.beta1 = options.adam_beta1;
  adam.beta2 = options.adam_beta2;
  adam.epsilon = options.adam_epsilon;
  adam.visible_only = options.sparse_adam;
  return adam;
}

AdamRates adam_rates_of(const TrainOptions& options,
                        double extent,
                        double motion,
                        std::int64_t iteration) {
  AdamRates rates;
  rates.means = motion * learning_rate(position_rate(options), options, iteration);
  rates.quaternions = learning_rate(rotation_rate(options), options, iteration);
  rates.scales = (options.scale_lr_by_extent ? extent : 1.0) *
                 learning_rate(scale_rate(options), options, iteration);
  rates.opacities = learning_rate(opacity_rate(options), options, iteration);
  const double color = color_share(options);
  rates.sh_dc = color * learning_rate(sh_rate(options), options, iteration);
  rates.sh_rest = color * learning_rate(sh_rest_rate(options), options, iteration);
  return rates;
}

}  // namespace raysplats
