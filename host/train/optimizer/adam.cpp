// SPDX-License-Identifier: Apache-2.0
#include "train/optimizer/adam.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "device/kernel.hpp"
#include "raysplats/error.hpp"
#include "train/optimizer/group_parts.hpp"
#include "train/optimizer/lanes.hpp"

namespace raysplats {

namespace {

constexpr char kProgram[] = "train/adam.cl";
// Gaussians that are looked at, and on CPUs updated, by one work-group.
constexpr std::size_t kBlock = 256;
constexpr std::size_t kGroup = 64;
constexpr std::size_t kCachedFloats = std::size_t{1} << 20;
// Groups of parameters begin at lines of 64 bytes.
constexpr std::size_t kLineFloats = 16;

// Gaussians that moments have room for.
std::size_t moment_rows(std::size_t count) {
  return (count + kLineFloats - 1) / kLineFloats * kLineFloats;
}

// Floats of one Gaussian in the groups before this one.
std::size_t floats_before(ParameterGroup group, int sh_degree) {
  std::size_t floats = 0;
  for (const ParameterGroup other : kParameterGroups) {
    if (other < group) floats += group_width(other, sh_degree);
  }
  return floats;
}

std::size_t gaussian_floats(int sh_degree) {
  return floats_before(ParameterGroup::kSh, sh_degree) +
         group_width(ParameterGroup::kSh, sh_degree);
}

std::size_t moment_floats(std::size_t count, int sh_degree) {
  return moment_rows(count) * gaussian_floats(sh_degree);
}

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

Kernel Adam::step_kernel(int sh_degree) const {
  BuildOptions build;
  build.define("LANES", lanes_)
      .define("BLOCK", kBlock)
      .define("GROUP", cpu_ ? 1 : kGroup)
      .define("SH_FLOATS", group_width(ParameterGroup::kSh, sh_degree));
  return context_.kernel(kProgram, "adam_step", build);
}

void Adam::begin_programs(int sh_degree) { step_kernel(sh_degree); }

void Adam::initialize(std::size_t count, int sh_degree) {
  first_.ensure(context_, moment_floats(count, sh_degree), "Adam first moments");
  second_.ensure(context_, moment_floats(count, sh_degree), "Adam second moments");
  first_.clear();
  second_.clear();
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
  const double of_groups[RS_PARAMETER_GROUPS + 1] = {
      rates.means, rates.quaternions, rates.scales, rates.opacities, rates.sh_dc, rates.sh_rest};
  std::transform(std::begin(of_groups), std::end(of_groups), std::begin(record.rates),
                 [bias1](double rate) { return static_cast<float>(rate / bias1); });
  record.rows = u32(moment_rows(count_));

  chosen_.ensure(context_, count_, "Gaussians that take the step");
  const std::size_t slice = slice_size();
  for (std::size_t begin = 0; begin < count_; begin += slice) {
    step_slice(begin, std::min(begin + slice, count_), gaussians, gradients, record,
               guard != nullptr ? *guard : open_guard_);
  }
}

// Gradients are read twice: on CPUs a part of the Gaussians goes all the way while they are in the
// cache.
std::size_t Adam::slice_size() const {
  if (!cpu_) return count_;
  return std::max<std::size_t>(1, kCachedFloats / gaussian_floats(sh_degree_) / kBlock) * kBlock;
}

void Adam::step_slice(std::size_t begin,
                      std::size_t end,
                      DeviceGaussians& gaussians,
                      const GaussianGradients& gradients,
                      RsAdam record,
                      const Buffer<std::uint32_t>& guard) {
  const std::size_t items = cpu_ ? 1 : kGroup;
  const std::size_t blocks = (end - begin + kBlock - 1) / kBlock;
  Range range = Range::linear(blocks * items, items);
  range.offset[0] = begin / kBlock * items;
  choose_kernel_.launch(range, gradients.means, gradients.quaternions, gradients.scales,
                        gradients.opacities, gradients.sh, gradients.screen, guard, u32(end),
                        u32(group_width(ParameterGroup::kSh, sh_degree_)),
                        options_.visible_only ? 1 : 0, chosen_, skipped_);
  record.begin = u32(begin);
  record.end = u32(end);
  const GroupParts work =
      cpu_ ? group_blocks(blocks)
           : group_parts(end - begin, sh_degree_, kGroup, static_cast<std::size_t>(lanes_));
  step_kernel(sh_degree_)
      .launch(work.range, gaussians.arguments(), gradients.Parameters::arguments(), first_, second_,
              chosen_, work.parts, record);
}

void Adam::remap(const Buffer<std::uint32_t>& source, std::size_t new_count) {
  if (source.size() < new_count) {
    throw UsageError(
        fmt::format("Adam was given {} source indices for {} Gaussians", source.size(), new_count));
  }
  for (Buffer<float>* moments : {&first_, &second_}) {
    Buffer<float> moved(context_, moment_floats(new_count, sh_degree_), "Adam moments");
    for (const ParameterGroup group : kParameterGroups) {
      const std::size_t width = group_width(group, sh_degree_);
      const std::size_t before = floats_before(group, sh_degree_);
      // Neighbours of GPUs touch neighbouring addresses.
      const std::size_t span = cpu_ ? width : 1;
      remap_kernel_.launch(Range::linear(new_count * width / span, kGroup), *moments, moved, source,
                           std::uint64_t{before * moment_rows(count_)},
                           std::uint64_t{before * moment_rows(new_count)}, u32(width), u32(span),
                           u32(new_count));
    }
    *moments = std::move(moved);
  }
  count_ = new_count;
}

std::size_t Adam::moment_place(ParameterGroup group) const {
  return floats_before(group, sh_degree_) * moment_rows(count_);
}

// Of the moments of a group.
std::size_t Adam::floats(ParameterGroup group) const {
  return count_ * group_width(group, sh_degree_);
}

std::vector<float> Adam::first_moments(ParameterGroup group) const {
  std::vector<float> out(floats(group));
  first_.download(out, moment_place(group));
  return out;
}

std::vector<float> Adam::second_moments(ParameterGroup group) const {
  std::vector<float> out(floats(group));
  second_.download(out, moment_place(group));
  return out;
}

void Adam::reset(ParameterGroup group) {
  for (Buffer<float>* moments : {&first_, &second_})
    moments->clear(floats(group), moment_place(group));
}

void Adam::restore(ParameterGroup group,
                   std::span<const float> first,
                   std::span<const float> second) {
  if (first.size() != floats(group) || second.size() != floats(group)) {
    throw UsageError(
        fmt::format("The {} moments given to Adam have {} and {} values, {} are expected",
                    group_name(group), first.size(), second.size(), floats(group)));
  }
  first_.upload(first, moment_place(group));
  second_.upload(second, moment_place(group));
}

}  // namespace raysplats
