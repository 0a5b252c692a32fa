// SPDX-License-Identifier: Apache-2.0
#include "train/density/density_control.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "raysplats/error.hpp"
#include "scene/gaussians/activation.hpp"
#include "train/density/mcmc.hpp"
#include "train/schedule.hpp"
#include "util/rng.hpp"

namespace raysplats {
namespace {

constexpr char kProgram[] = "train/density_control.cl";
constexpr std::size_t kGroup = 64;
constexpr std::uint64_t kSplitStream = 0x73706c6974;
constexpr std::uint64_t kMoveStream = 0x6d6f7665;

constexpr std::int64_t kLeastPeriod = 50;   // iterations between passes
constexpr double kShortRunShare = 0.1;      // but not more than this share of a short run
constexpr std::int64_t kShortPeriod = 10;   // and not less than these iterations
constexpr double kPeriodShare = 0.01;       // of the run
constexpr double kJustBelow = 0.7;          // of what a period is at least
constexpr double kLongestPassShare = 0.05;  // longer passes over the photos are not waited for
constexpr double kLeastOpacity = 0.004;     // that fading leaves
constexpr double kMcmcGrowth = 1.05;        // of the count in a pass of 3DGS-MCMC, at least

// Iterations between two passes when the options leave them open.
std::int64_t fitted_period(const TrainOptions& options, std::int64_t views) {
  const std::int64_t together = options.views_per_step;
  const auto share = [&](double s) {
    return std::llround(s * static_cast<double>(options.iterations));
  };
  const std::int64_t usual =
      std::clamp<std::int64_t>(share(kShortRunShare), kShortPeriod, kLeastPeriod);
  const std::int64_t least = std::max<std::int64_t>(usual, share(kPeriodShare));
  const std::int64_t most =
      std::max(2 * least, static_cast<std::int64_t>(share(kLongestPassShare)));
  const std::int64_t pass = pass_steps(views, together);
  for (std::int64_t whole = (least + pass - 1) / pass * pass; whole <= most; whole += pass) {
    if (!shows_all(whole, views, together)) continue;
    // Short runs have few passes to grow in, and random starts are cleared by each: for these one
    // that comes a little early is better than one that takes nearly twice as long.
    const bool hurries = whole > share(kShortRunShare) || clears_random_start(options);
    const std::int64_t before = whole - pass;
    const bool nearer = static_cast<double>(whole) > static_cast<double>(least) / kJustBelow &&
                        static_cast<double>(before) >= kJustBelow * static_cast<double>(least);
    return hurries && nearer && shows_all(before, views, together) ? before : whole;
  }
  return least;
}

std::uint32_t low_word(std::uint64_t bits) { return static_cast<std::uint32_t>(bits); }

}  // namespace

DensityControl::DensityControl(Context& context,
                               const TrainOptions& options,
                               double extent,
                               std::size_t views)
    : context_(context), extent_(extent), open_guard_(context, 1, "density guard") {
  open_guard_.clear();
  follow(options, views);
}

void DensityControl::follow(const TrainOptions& options, std::size_t views) {
  options_ = options;
  limit_ = static_cast<std::size_t>(options.max_gaussians);
  first_ = options.densify_from.of(options.iterations);
  growth_end_ = options.densify_until.of(options.iterations);
  last_ = growth_end_;
  period_ = options.densify_every.of(options.iterations);
  const auto all = static_cast<std::int64_t>(std::max<std::size_t>(views, 1));
  if (period_ == 0) period_ = fitted_period(options, all);
  decay_ = options.strategy == DensityStrategy::kBudget
               ? pass_decay(options, pass_steps(all, options.views_per_step))
               : 0;
  whole_passes_ = shows_all(period_, all, options.views_per_step);
  if (options.strategy != DensityStrategy::kAdc && growth_end_ > 0)
    last_ = std::max(last_, options.replace_until.of(options.iterations));
}

void DensityControl::accumulate(const DeviceGaussians& gaussians,
                                const GaussianGradients& gradients,
                                const Buffer<std::uint32_t>* guard) {
  if (options_.densify_signal == DensifySignal::kStep) return;
  if (statistics_.size() != kDensityStatistics * gaussians.count) {
    statistics_ =
        Buffer<float>(context_, kDensityStatistics * gaussians.count, "density statistics");
    statistics_.clear();
  }
  const DensifySignal signal_choice =
      options_.densify_signal != DensifySignal::kAuto ? options_.densify_signal
      : options_.strategy == DensityStrategy::kBudget ? DensifySignal::kAbsolute
                                                      : DensifySignal::kScreen;
  const std::uint32_t signal = signal_choice == DensifySignal::kAbsolute ? 1u : 0u;
  context_.kernel(kProgram, "accumulate_screen")
      .launch(Range::linear(gaussians.count, kGroup), static_cast<std::uint32_t>(gaussians.count),
              signal, gradients.screen, guard != nullptr ? *guard : open_guard_, statistics_);
}

bool DensityControl::measures_step(std::int64_t iteration) const {
  return options_.densify_signal == DensifySignal::kStep && refines_at(iteration + 1);
}

void DensityControl::begin_step(const DeviceGaussians& gaussians) {
  old_means_.ensure(context_, 3 * gaussians.count, "means before a step");
  old_means_.copy_from(gaussians.means, 3 * gaussians.count, 0);
}

void DensityControl::end_step(const DeviceGaussians& gaussians,
                              const Buffer<std::uint32_t>& guard) {
  statistics_ = Buffer<float>(context_, kDensityStatistics * gaussians.count, "density statistics");
  statistics_.clear();
  context_.kernel(kProgram, "measure_step")
      .launch(Range::linear(gaussians.count, kGroup), static_cast<std::uint32_t>(gaussians.count),
              static_cast<float>(1.0 / extent_), old_means_, gaussians.means, guard, statistics_);
}

bool DensityControl::refines_at(std::int64_t iteration) const {
  return iteration >= first_ && iteration <= last_ && iteration % period_ == 0;
}

bool DensityControl::idles_at(std::int64_t iteration) const {
  return iteration > last_ && iteration % period_ == 0;
}

bool DensityControl::resets_at(std::int64_t iteration) const {
  return options_.opacity_reset_every > 0 && iteration <= growth_end_ &&
         iteration % options_.opacity_reset_every == 0;
}

// The count after this pass: of the way to the limit, (1 - x)^2 is left at the share x of the time
// for growth (Mallick et al. 2024, "Taming 3DGS"), wherever this pass finds the model.
std::size_t DensityControl::target(std::size_t count, std::int64_t iteration) const {
  if (count >= limit_) return limit_;
  if (iteration > growth_end_) return count;
  if (iteration == growth_end_) return limit_;  // growth may be one pass alone
  const auto left = [this](std::int64_t at) {
    const auto span = static_cast<double>(growth_end_ - first_);
    return std::clamp(static_cast<double>(growth_end_ - at) / span, 0.0, 1.0);
  };
  const double before = left(iteration - period_), now = left(iteration);
  const double rest = static_cast<double>(limit_ - count) * now * now / (before * before);
  return limit_ - static_cast<std::size_t>(rest);
}

DensityPlan DensityControl::plan(const DeviceGaussians& gaussians, std::int64_t iteration) const {
  std::vector<float> statistics(kDensityStatistics * gaussians.count, 0.0f);
  const bool known = statistics_.size() == statistics.size();
  if (known) statistics_.download(statistics);
  const std::vector<float> means = gaussians.means.download();
  const std::vector<float> scales = gaussians.scales.download();
  const std::vector<float> opacities = gaussians.opacities.download();
  if (options_.strategy == DensityStrategy::kBudget) {
    BudgetRules rules;
    rules.target = target(gaussians.count, iteration);
    rules.min_opacity = options_.prune_opacity;
    rules.bounds = options_.bounds;
    rules.remove_unseen = known && whole_passes_ && iteration >= first_ + period_;
    rules.remove_hardly_seen = rules.remove_unseen;
    return plan_budget(means, scales, opacities, statistics, rules);
  }
  DensityRules rules;
  rules.gradient = options_.densify_grad_threshold;
  rules.split_size = options_.densify_size * extent_;
  rules.min_opacity = options_.prune_opacity;
  rules.max_size = options_.prune_scale * extent_;
  rules.min_size = options_.prune_scale_min * extent_;
  rules.measure = options_.densify_measure;
  rules.max_count = limit_;
  rules.activation = gaussians.activation;
  rules.bounds = options_.bounds;
  return plan_density(means, scales, opacities, statistics, rules);
}

RelocationPlan DensityControl::plan_moves(const DeviceGaussians& gaussians,
                                          std::int64_t iteration) const {
  const std::size_t count = gaussians.count;
  const auto grown = static_cast<std::size_t>(kMcmcGrowth * static_cast<double>(count));
  RelocationRules rules;
  rules.target = count;
  if (iteration <= growth_end_)
    rules.target = std::min(limit_, std::max(grown, target(count, iteration)));
  rules.dead_opacity = options_.prune_opacity;
  rules.bounds = options_.bounds;
  rules.seed = CounterRng(options_.seed, kMoveStream, static_cast<std::uint64_t>(iteration)).bits();
  return plan_relocation(gaussians.means.download(), gaussians.scales.download(),
                         gaussians.opacities.download(), rules);
}

DensityPlan DensityControl::refine(DeviceGaussians& gaussians, std::int64_t iteration) {
  const bool moves = options_.strategy == DensityStrategy::kMcmc;
  RelocationPlan relocation;
  if (moves) relocation = plan_moves(gaussians, iteration);
  DensityPlan plan = moves ? std::move(relocation.density) : this->plan(gaussians, iteration);
  if (plan.source.empty()) {
    throw Error(ErrorCode::kRuntime,
                fmt::format("Density control at iteration {} would remove all {} Gaussians: {}",
                            iteration, gaussians.count, plan.remedy()));
  }
  if (plan.changes()) gather(gaussians, plan, iteration);
  if (moves && plan.changes()) apply_shares(context_, relocation.shares, gaussians);
  if (decay_ > 0) fade_opacities(gaussians);
  // Without changes the statistics start anew all the same, as in 3DGS.
  if (statistics_.size() == kDensityStatistics * gaussians.count) {
    statistics_.clear();
  } else {
    statistics_ = Buffer<float>();
  }
  return plan;
}

DensityPlan DensityControl::split_evenly(DeviceGaussians& gaussians, std::size_t most) {
  BudgetRules rules;
  rules.target = most;
  const std::vector<float> alike(kDensityStatistics * gaussians.count, 1.0f);
  DensityPlan plan = plan_budget(gaussians.means.download(), gaussians.scales.download(),
                                 gaussians.opacities.download(), alike, rules);
  if (plan.changes()) gather(gaussians, plan, 0);
  statistics_ = Buffer<float>();
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
  next.ensure(context_, count, gaussians.sh_degree, "parameters");
  const std::uint64_t key =
      CounterRng(options_.seed, kSplitStream, static_cast<std::uint64_t>(iteration)).bits();
  BuildOptions build;
  build.define("SH_COEFFICIENTS", sh);
  build.define("SIGMOID_SCALE", gaussians.activation == ScaleActivation::kSigmoid ? 1 : 0);
  context_.kernel(kProgram, "gather_gaussians", build)
      .launch(Range::linear(count, kGroup), static_cast<std::uint32_t>(count), low_word(key),
              low_word(key >> 32), static_cast<float>(options_.split_factor), source, role,
              gaussians.means, gaussians.quaternions, gaussians.scales, gaussians.opacities,
              gaussians.sh, next.means, next.quaternions, next.scales, next.opacities, next.sh);
  gaussians = std::move(next);
  gaussians.changed(context_);
}

void DensityControl::fade_opacities(DeviceGaussians& gaussians) {
  context_.kernel(kProgram, "fade_opacity")
      .launch(Range::linear(gaussians.count, kGroup), static_cast<std::uint32_t>(gaussians.count),
              static_cast<float>(decay_), static_cast<float>(kLeastOpacity), gaussians.opacities);
  gaussians.changed(context_);
}

void DensityControl::reset_opacities(DeviceGaussians& gaussians) {
  const double value = options_.opacity_reset_value;
  const auto limit = static_cast<float>(logit(value));
  context_.kernel(kProgram, "limit_opacity")
      .launch(Range::linear(gaussians.count, kGroup), static_cast<std::uint32_t>(gaussians.count),
              limit, gaussians.opacities);
  gaussians.changed(context_);
}

void DensityControl::restore_statistics(std::span<const float> statistics) {
  statistics_ = Buffer<float>();
  if (statistics.empty()) return;
  statistics_ = Buffer<float>(context_, statistics.size(), "density statistics");
  statistics_.upload(statistics);
}

}  // namespace raysplats
