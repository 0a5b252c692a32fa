// SPDX-License-Identifier: Apache-2.0
#include "train/density_control.hpp"

#include <fmt/format.h>

#include <cmath>

#include "base/rng.hpp"
#include "raysplats/error.hpp"

namespace raysplats {
namespace {

constexpr char kProgram[] = "train/densify.cl";
constexpr std::size_t kGroup = 64;
constexpr std::uint64_t kSplitStream = 0x73706c6974;

std::uint32_t low_word(std::uint64_t bits) { return static_cast<std::uint32_t>(bits); }

}  // namespace

DensityControl::DensityControl(Context& context, const TrainOptions& options, double extent)
    : context_(context),
      options_(options),
      extent_(extent),
      open_guard_(context, 1, "density guard") {
  open_guard_.clear();
}

void DensityControl::accumulate(const DeviceGaussians& gaussians,
                                const GaussianGradients& gradients,
                                const Buffer<std::uint32_t>* guard) {
  if (statistics_.size() != 2 * gaussians.count) {
    statistics_ = Buffer<float>(context_, 2 * gaussians.count, "density statistics");
    statistics_.clear();
  }
  const std::uint32_t signal = options_.densify_signal == DensifySignal::kAbsolute ? 1u : 0u;
  context_.kernel(kProgram, "accumulate_screen")
      .launch(Range::linear(gaussians.count, kGroup), static_cast<std::uint32_t>(gaussians.count),
              signal, gradients.screen, guard != nullptr ? *guard : open_guard_, statistics_);
}

bool DensityControl::refines_at(std::int64_t iteration) const {
  return iteration >= options_.densify_from && iteration <= options_.densify_until &&
         iteration % options_.densify_every == 0;
}

bool DensityControl::resets_at(std::int64_t iteration) const {
  return options_.opacity_reset_every > 0 && iteration <= options_.densify_until &&
         iteration % options_.opacity_reset_every == 0;
}

DensityPlan DensityControl::refine(DeviceGaussians& gaussians, std::int64_t iteration) {
  DensityRules rules;
  rules.gradient = options_.densify_grad_threshold;
  rules.split_size = options_.densify_size * extent_;
  rules.min_opacity = options_.prune_opacity;
  rules.max_size = options_.prune_scale * extent_;
  rules.min_size = options_.prune_scale_min * extent_;
  rules.max_count = static_cast<std::size_t>(options_.max_gaussians);
  rules.activation = gaussians.activation;
  std::vector<float> statistics(2 * gaussians.count, 0.0f);
  if (statistics_.size() == statistics.size()) statistics_.download(statistics);
  DensityPlan plan = plan_density(gaussians.means.download(), gaussians.scales.download(),
                                  gaussians.opacities.download(), statistics, rules);
  if (plan.source.empty()) {
    throw Error(ErrorCode::kRuntime, fmt::format("Density control at iteration {} would remove all "
                                                 "{} Gaussians: lower --prune-opacity or "
                                                 "the learning rates",
                                                 iteration, gaussians.count));
  }
  if (plan.changes()) gather(gaussians, plan, iteration);
  // Without changes the statistics start anew all the same, as in 3DGS.
  if (statistics_.size() == 2 * gaussians.count) {
    statistics_.clear();
  } else {
    statistics_ = Buffer<float>();
  }
  return plan;
}

void DensityControl::gather(DeviceGaussians& gaussians,
                            const DensityPlan& plan,
                            std::int64_t iteration) {
  const std::size_t count = plan.source.size();
  const auto sh = static_cast<std::size_t>(sh_coefficients(gaussians.sh_degree));
  Buffer<std::uint32_t> source(context_, count, "density sources");
  Buffer<std::uint32_t> role(context_, count, "density roles");
  source.upload(plan.source);
  role.upload(plan.role);
  DeviceGaussians next;
  next.count = count;
  next.sh_degree = gaussians.sh_degree;
  next.active_sh_degree = gaussians.active_sh_degree;
  next.activation = gaussians.activation;
  next.means = Buffer<float>(context_, 3 * count, "means");
  next.quaternions = Buffer<float>(context_, 4 * count, "quaternions");
  next.scales = Buffer<float>(context_, 3 * count, "scales");
  next.opacities = Buffer<float>(context_, count, "opacities");
  next.sh = Buffer<float>(context_, 3 * sh * count, "sh");
  const std::uint64_t key =
      CounterRng(options_.seed, kSplitStream, static_cast<std::uint64_t>(iteration)).bits();
  BuildOptions build;
  build.define("SH_COEFFICIENTS", sh);
  build.define("SCALE_SIGMOID", gaussians.activation == ScaleActivation::kSigmoid ? 1 : 0);
  context_.kernel(kProgram, "gather_gaussians", build)
      .launch(Range::linear(count, kGroup), static_cast<std::uint32_t>(count), low_word(key),
              low_word(key >> 32), static_cast<float>(options_.split_factor), source, role,
              gaussians.means, gaussians.quaternions, gaussians.scales, gaussians.opacities,
              gaussians.sh, next.means, next.quaternions, next.scales, next.opacities, next.sh);
  gaussians = std::move(next);
}

void DensityControl::reset_opacities(DeviceGaussians& gaussians) {
  const double value = options_.opacity_reset_value;
  const auto limit = static_cast<float>(std::log(value / (1.0 - value)));
  context_.kernel(kProgram, "limit_opacity")
      .launch(Range::linear(gaussians.count, kGroup), static_cast<std::uint32_t>(gaussians.count),
              limit, gaussians.opacities);
}

void DensityControl::restore_statistics(std::span<const float> statistics) {
  statistics_ = Buffer<float>();
  if (statistics.empty()) return;
  statistics_ = Buffer<float>(context_, statistics.size(), "density statistics");
  statistics_.upload(statistics);
}

}  // namespace raysplats
