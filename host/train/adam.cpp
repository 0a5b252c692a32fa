// SPDX-License-Identifier: Apache-2.0
#include "train/adam.hpp"

#include <fmt/format.h>

#include <cmath>

#include "raysplats/error.hpp"
#include "train/lanes.hpp"

namespace raysplats {

const char* group_name(ParameterGroup group) {
  switch (group) {
    case ParameterGroup::kMeans:
      return "means";
    case ParameterGroup::kQuaternions:
      return "quaternions";
    case ParameterGroup::kScales:
      return "scales";
    case ParameterGroup::kOpacities:
      return "opacities";
    case ParameterGroup::kSh:
      return "sh";
  }
  return "";
}

Adam::Adam(Context& context, const AdamOptions& options, int vector)
    : context_(context),
      options_(options),
      serial_(context.device().type == DeviceType::kCpu),
      skipped_(context, 1, "Adam skipped updates"),
      open_guard_(context, 1, "Adam guard") {
  if (!(options.beta1 >= 0 && options.beta1 < 1 && options.beta2 >= 0 && options.beta2 < 1 &&
        options.epsilon > 0)) {
    throw UsageError(fmt::format(
        "Adam got beta1 {}, beta2 {} and epsilon {}; betas are in [0, 1), epsilon is positive",
        options.beta1, options.beta2, options.epsilon));
  }
  block_ = serial_ ? 64 : 4;
  BuildOptions build;
  build.define("VECTOR", lane_count(context.device(), vector)).define("BLOCK", block_);
  step_kernel_ = context.kernel("train/adam.cl", "adam_step", build);
  remap_kernel_ = context.kernel("train/adam.cl", "remap_rows", build);
  skipped_.clear();
  open_guard_.clear();
}

void Adam::initialize(std::size_t count, int sh_degree) {
  const std::size_t sh_floats = 3 * static_cast<std::size_t>(sh_coefficients(sh_degree));
  const std::array<std::size_t, kParameterGroups.size()> widths{3, 4, 3, 1, sh_floats};
  for (std::size_t i = 0; i < widths.size(); ++i) {
    moments_[i].width = widths[i];
    moments_[i].first.ensure(context_, widths[i] * count, "Adam first moment");
    moments_[i].second.ensure(context_, widths[i] * count, "Adam second moment");
    reset(kParameterGroups[i]);
  }
  count_ = count;
  steps_ = 0;
}

void Adam::step(DeviceGaussians& gaussians,
                const GaussianGradients& gradients,
                const AdamRates& rates,
                const Buffer<std::uint32_t>* guard) {
  if (moments_[0].width == 0) initialize(gaussians.count, gaussians.sh_degree);
  Moments& sh = moments(ParameterGroup::kSh);
  const std::size_t sh_floats = 3 * static_cast<std::size_t>(sh_coefficients(gaussians.sh_degree));
  if (gaussians.count != count_ || sh_floats != sh.width) {
    throw UsageError(fmt::format(
        "Adam holds moments of {} Gaussians with {} SH values and was given {} with {}; "
        "remap or initialise it first",
        count_, sh.width, gaussians.count, sh_floats));
  }
  ++steps_;
  if (count_ == 0) return;
  gaussians.changed(context_);
  const double bias1 = 1.0 - std::pow(options_.beta1, static_cast<double>(steps_));
  const double bias2 = 1.0 - std::pow(options_.beta2, static_cast<double>(steps_));
  const auto rate = [&](double learning_rate) { return static_cast<float>(learning_rate / bias1); };

  Range range{{(count_ + block_ - 1) / block_, 1, 1}, {0, 0, 0}};
  if (serial_) range.local = {1, 1, 1};
  Moments& mean = moments(ParameterGroup::kMeans);
  Moments& quaternion = moments(ParameterGroup::kQuaternions);
  Moments& scale = moments(ParameterGroup::kScales);
  Moments& opacity = moments(ParameterGroup::kOpacities);
  step_kernel_.launch(
      range, gaussians.means, gradients.means, mean.first, mean.second, gaussians.quaternions,
      gradients.quaternions, quaternion.first, quaternion.second, gaussians.scales,
      gradients.scales, scale.first, scale.second, gaussians.opacities, gradients.opacities,
      opacity.first, opacity.second, gaussians.sh, gradients.sh, sh.first, sh.second,
      gradients.screen, skipped_, guard != nullptr ? *guard : open_guard_,
      static_cast<std::uint32_t>(count_), static_cast<std::int32_t>(sh_floats), rate(rates.means),
      rate(rates.quaternions), rate(rates.scales), rate(rates.opacities), rate(rates.sh_dc),
      rate(rates.sh_rest), static_cast<float>(options_.beta1),
      static_cast<float>(1.0 - options_.beta1), static_cast<float>(options_.beta2),
      static_cast<float>(1.0 - options_.beta2), static_cast<float>(options_.epsilon),
      static_cast<float>(1.0 / std::sqrt(bias2)), options_.visible_only ? 1 : 0);
}

void Adam::remap(const Buffer<std::uint32_t>& source, std::size_t new_count) {
  if (source.size() < new_count) {
    throw UsageError(
        fmt::format("Adam was given {} source indices for {} Gaussians", source.size(), new_count));
  }
  const auto move = [&](Buffer<float>& from, std::size_t width, const char* label) {
    Buffer<float> to(context_, width * new_count, label);
    Range range{{new_count, 1, 1}, {0, 0, 0}};
    if (new_count > 0) {
      remap_kernel_.launch(range, from, to, source, static_cast<std::int32_t>(width),
                           static_cast<std::uint32_t>(new_count));
    }
    from = std::move(to);
  };
  for (Moments& group : moments_) {
    move(group.first, group.width, "Adam first moment");
    move(group.second, group.width, "Adam second moment");
  }
  count_ = new_count;
}

void Adam::reset(ParameterGroup group) {
  moments(group).first.clear();
  moments(group).second.clear();
}

void Adam::restore(ParameterGroup group,
                   std::span<const float> first,
                   std::span<const float> second) {
  Moments& target = moments(group);
  if (first.size() != target.first.size() || second.size() != target.second.size()) {
    throw UsageError(
        fmt::format("The {} moments given to Adam have {} and {} values, {} are expected",
                    group_name(group), first.size(), second.size(), target.first.size()));
  }
  target.first.upload(first);
  target.second.upload(second);
}

}  // namespace raysplats
