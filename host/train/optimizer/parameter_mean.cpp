// SPDX-License-Identifier: Apache-2.0
#include "train/optimizer/parameter_mean.hpp"

#include <algorithm>
#include <cstddef>

#include "train/optimizer/group_parts.hpp"
#include "train/schedule.hpp"

namespace raysplats {
namespace {

constexpr char kProgram[] = "train/parameter_mean.cl";
constexpr std::size_t kGroup = 64;

}  // namespace

// Steps before the first sample.
std::int64_t ParameterMean::first(const TrainOptions& options) const {
  return std::max(mean_from(options), since_);
}

void ParameterMean::shape(const DeviceGaussians& like) {
  mean_.count = like.count;
  mean_.sh_degree = like.sh_degree;
  mean_.active_sh_degree = like.active_sh_degree;
  mean_.activation = like.activation;
  mean_.ensure(context_, like.count, like.sh_degree, "mean parameters");
}

bool ParameterMean::add(const TrainOptions& options,
                        const DeviceGaussians& gaussians,
                        std::int64_t iteration,
                        const Buffer<std::uint32_t>& guard) {
  if (iteration <= mean_from(options)) return false;
  // Other Gaussians have no mean with those before, and no room in it: steps that are timed before
  // a run come to its end with more and more of them.
  if (known() && mean_.count != gaussians.count) restart(iteration - 1);
  if (!known() && iteration > first(options) + 1) restart(iteration - 1);
  const std::int64_t before = first(options);
  const std::int64_t samples = std::max<std::int64_t>(last_iteration(options) - before, 1);
  const std::int64_t every = (samples + kMostSamples - 1) / kMostSamples;
  const std::int64_t step = iteration - before - 1;
  if (step % every != 0) return false;
  if (step == 0) shape(gaussians);
  const std::int64_t number = step / every + 1;
  const auto share = static_cast<float>(1.0 / static_cast<double>(number));
  if (step == 0) {
    for_each_group(
        [&](ParameterGroup group, Buffer<float>& mean, const Buffer<float>& parameters) {
          mean.copy_from(parameters, gaussians.count * group_width(group, gaussians.sh_degree));
        },
        mean_, gaussians);
  } else if (gaussians.count > 0) {
    BuildOptions build;
    build.define("SH_FLOATS", group_width(ParameterGroup::kSh, gaussians.sh_degree));
    const GroupParts work = group_parts(gaussians.count, gaussians.sh_degree, kGroup);
    context_.kernel(kProgram, "add_sample", build)
        .launch(work.range, u32(gaussians.count), share, work.parts, guard, gaussians.arguments(),
                mean_.arguments());
  }
  mean_.changed(context_);
  return true;
}

void ParameterMean::restart(std::int64_t iteration) {
  mean_ = DeviceGaussians();
  since_ = iteration;
}

bool ParameterMean::restore(const TrainOptions& options,
                            const DeviceGaussians& like,
                            std::int64_t iteration,
                            std::int64_t since) {
  restart(since);
  if (iteration <= first(options)) return false;
  shape(like);
  mean_.changed(context_);
  return true;
}

}  // namespace raysplats
