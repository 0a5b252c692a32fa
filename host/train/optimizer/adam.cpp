// SPDX-License-Identifier: Apache-2.0
#include "train/optimizer/adam.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "device/kernel.hpp"
#include "raysplats/error.hpp"
#include "train/optimizer/lanes.hpp"

namespace raysplats {

namespace {

constexpr char kProgram[] = "train/adam.cl";
// Gaussians that are looked at, and on CPUs updated, by one work-group.
constexpr std::size_t kBlock = 256;
constexpr std::size_t kGroup = 64;
constexpr std::size_t kCachedFloats = std::size_t{1} << 20;

}  // namespace

Adam::Adam(Context& context, const AdamOptions& options, int vector)
    : context_(context),
      options_(options),
      cpu_(context.device().type == DeviceType::kCpu),
      lanes_(cpu_ || vector != 0 ? lane_count(context.device(), vector) : 1),
      skipped_(context, 1, "Adam skipped updates"),
      open_guard_(context, 1, "Adam guard") {
  if (!(options.beta1 >= 0 && options.beta1 < 1 && options.beta2 >= 0 && options.beta2 < 1 &&
        options.epsilon > 0)) {
    throw UsageError(fmt::format(
        "Adam got beta1 {}, beta2 {} and epsilon {}; betas are in [0, 1), epsilon is positive",
        options.beta1, options.beta2, options.epsilon));
  }
  BuildOptions build;
  build.define("LANES", lanes_).define("BLOCK", kBlock).define("GROUP", cpu_ ? 1 : kGroup);
  choose_kernel_ = context.kernel(kProgram, "choose_steps", build);
  remap_kernel_ = context.kernel(kProgram, "remap_rows", build);
  skipped_.clear();
  open_guard_.clear();
}

// A work-item takes the floats of a block of Gaussians on CPUs, elsewhere one vector.
Kernel Adam::step_kernel(ParameterGroup group, int sh_degree) const {
  const std::size_t width = group_width(group, sh_degree);
  BuildOptions build;
  build.define("LANES", lanes_)
      .define("WIDTH", width)
      .define("SPAN", cpu_ ? kBlock * width : static_cast<std::size_t>(lanes_));
  return context_.kernel(kProgram, "adam_step", build);
}

void Adam::begin_programs(int sh_degree) {
  for (const ParameterGroup group : kParameterGroups) step_kernel(group, sh_degree);
}

void Adam::initialize(std::size_t count, int sh_degree) {
  first_.ensure(context_, count, sh_degree, "Adam first moments");
  second_.ensure(context_, count, sh_degree, "Adam second moments");
  for (const ParameterGroup group : kParameterGroups) reset(group);
  skipped_.clear();
  initialized_ = true;
  count_ = count;
  sh_degree_ = sh_degree;
  steps_ = 0;
}

void Adam::step(DeviceGaussians& gaussians,
                const GaussianGradients& gradients,
                const AdamRates& rates,
                const Buffer<std::uint32_t>* guard) {
  if (!initialized_) initialize(gaussians.count, gaussians.sh_degree);
  if (gaussians.count != count_ || gaussians.sh_degree != sh_degree_) {
    throw UsageError(fmt::format(
        "Adam holds moments of {} Gaussians of SH degree {} and was given {} of degree {}; remap "
        "or initialise it first",
        count_, sh_degree_, gaussians.count, gaussians.sh_degree));
  }
  ++steps_;
  if (count_ == 0) return;
  gaussians.changed(context_);
  const double bias1 = 1.0 - std::pow(options_.beta1, static_cast<double>(steps_));
  const double bias2 = 1.0 - std::pow(options_.beta2, static_cast<double>(steps_));
  RsAdam record{};
  record.beta1 = static_cast<float>(options_.beta1);
  record.rest1 = static_cast<float>(1.0 - options_.beta1);
  record.beta2 = static_cast<float>(options_.beta2);
  record.rest2 = static_cast<float>(1.0 - options_.beta2);
  record.epsilon = static_cast<float>(options_.epsilon);
  record.root_scale = static_cast<float>(1.0 / std::sqrt(bias2));

  chosen_.ensure(context_, count_, "Gaussians that take the step");
  const std::size_t slice = slice_size();
  for (std::size_t begin = 0; begin < count_; begin += slice) {
    step_slice(begin, std::min(begin + slice, count_), gaussians, gradients, rates, bias1, record,
               guard != nullptr ? *guard : open_guard_);
  }
}

// Gradients are read twice: on CPUs a part of the Gaussians goes all the way while they are in the
// cache.
std::size_t Adam::slice_size() const {
  if (!cpu_) return count_;
  std::size_t floats = 0;
  for (const ParameterGroup group : kParameterGroups) floats += group_width(group, sh_degree_);
  return std::max<std::size_t>(1, kCachedFloats / floats / kBlock) * kBlock;
}

void Adam::step_slice(std::size_t begin,
                      std::size_t end,
                      DeviceGaussians& gaussians,
                      const GaussianGradients& gradients,
                      const AdamRates& rates,
                      double bias1,
                      RsAdam record,
                      const Buffer<std::uint32_t>& guard) {
  const std::size_t items = cpu_ ? 1 : kGroup;
  Range blocks = Range::linear((end - begin + kBlock - 1) / kBlock * items, items);
  blocks.offset[0] = begin / kBlock * items;
  choose_kernel_.launch(blocks, gradients.means, gradients.quaternions, gradients.scales,
                        gradients.opacities, gradients.sh, gradients.screen, guard, u32(end),
                        u32(group_width(ParameterGroup::kSh, sh_degree_)),
                        options_.visible_only ? 1 : 0, chosen_, skipped_);
  const double group_rates[kParameterGroups.size()] = {rates.means, rates.quaternions, rates.scales,
                                                       rates.opacities, rates.sh_dc};
  for_each_group(
      [&](ParameterGroup group, Buffer<float>& parameter, const Buffer<float>& gradient,
          Buffer<float>& first, Buffer<float>& second) {
        const std::size_t width = group_width(group, sh_degree_);
        const std::size_t span = cpu_ ? kBlock * width : static_cast<std::size_t>(lanes_);
        record.rate = static_cast<float>(group_rates[static_cast<std::size_t>(group)] / bias1);
        record.rest_rate = static_cast<float>(rates.sh_rest / bias1);
        Range range = Range::linear(((end - begin) * width + span - 1) / span, cpu_ ? 1 : kGroup);
        range.offset[0] = begin * width / span;
        step_kernel(group, sh_degree_)
            .launch(range, parameter, gradient, first, second, chosen_, u32(end), record);
      },
      gaussians, gradients, first_, second_);
}

void Adam::remap(const Buffer<std::uint32_t>& source, std::size_t new_count) {
  if (source.size() < new_count) {
    throw UsageError(
        fmt::format("Adam was given {} source indices for {} Gaussians", source.size(), new_count));
  }
  for (Parameters* moments : {&first_, &second_}) {
    for_each_group(
        [&](ParameterGroup group, Buffer<float>& from) {
          const std::size_t width = group_width(group, sh_degree_);
          Buffer<float> to(context_, width * new_count, "Adam moments");
          if (new_count > 0) {
            // Neighbours of GPUs touch neighbouring addresses.
            const std::size_t span = cpu_ ? width : 1;
            remap_kernel_.launch(Range{{new_count * width / span, 1, 1}, {0, 0, 0}}, from, to,
                                 source, u32(width), u32(span), u32(new_count));
          }
          from = std::move(to);
        },
        *moments);
  }
  count_ = new_count;
}

void Adam::reset(ParameterGroup group) {
  first_[group].clear();
  second_[group].clear();
}

void Adam::restore(ParameterGroup group,
                   std::span<const float> first,
                   std::span<const float> second) {
  if (first.size() != first_[group].size() || second.size() != second_[group].size()) {
    throw UsageError(
        fmt::format("The {} moments given to Adam have {} and {} values, {} are expected",
                    group_name(group), first.size(), second.size(), first_[group].size()));
  }
  first_[group].upload(first);
  second_[group].upload(second);
}

}  // namespace raysplats
