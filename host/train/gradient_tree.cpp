// SPDX-License-Identifier: Apache-2.0
#include "train/gradient_tree.hpp"

#include <utility>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kGroup = 64;

}  // namespace

// later = earlier + later.
void GradientTree::join(const StepGradients& earlier, StepGradients& later) {
  Kernel add = context_.kernel("train/gradient_tree.cl", "add_numbers");
  const auto join_numbers = [&add](const Buffer<float>& first, const Buffer<float>& second) {
    add.launch(Range::linear(second.size(), kGroup), first, second, second,
               static_cast<std::uint64_t>(second.size()));
  };
  for_each_group([&](ParameterGroup, const Buffer<float>& first,
                     const Buffer<float>& second) { join_numbers(first, second); },
                 earlier.gaussians, later.gaussians);
  join_numbers(earlier.gaussians.screen, later.gaussians.screen);
  if (later.sky.size() > 0) join_numbers(earlier.sky, later.sky);
}

void GradientTree::clear() {
  for (Level& level : levels_) level.full = false;
}

void GradientTree::add(StepGradients& slot) {
  std::size_t level = 0;
  for (; level < levels_.size() && levels_[level].full; ++level) {
    join(levels_[level].gradients, slot);
    levels_[level].full = false;
  }
  if (level == levels_.size()) levels_.emplace_back();
  std::swap(levels_[level].gradients, slot);
  levels_[level].full = true;
}

void GradientTree::finish(StepGradients& sum) {
  bool any = false;
  for (Level& level : levels_) {
    if (!level.full) continue;
    if (any) join(level.gradients, sum);
    if (!any) std::swap(level.gradients, sum);
    any = true;
    level.full = false;
  }
  if (!any) throw UsageError("There are no gradients to add: give those of one view or more");
}

}  // namespace raysplats
