// SPDX-License-Identifier: Apache-2.0
#include "train/gradient_tree.hpp"

#include <utility>

#include "raysplats/error.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kGroup = 64;

}  // namespace

// left += right, whose buffers are spare then.
void GradientTree::join(StepGradients& left, StepGradients& right) {
  Kernel add = context_.kernel("train/gradient_tree.cl", "add_numbers");
  const auto join_numbers = [&add](const Buffer<float>& first, const Buffer<float>& second) {
    add.launch(Range::linear(second.size(), kGroup), first, second, first,
               static_cast<std::uint64_t>(second.size()));
  };
  for_each_group([&](ParameterGroup, const Buffer<float>& first,
                     const Buffer<float>& second) { join_numbers(first, second); },
                 left.gaussians, right.gaussians);
  join_numbers(left.gaussians.screen, right.gaussians.screen);
  if (right.sky.size() > 0) join_numbers(left.sky, right.sky);
  spare_.push_back(std::move(right));
}

void GradientTree::clear() {
  for (Part& part : sum_.take()) spare_.push_back(std::move(part.second));
}

void GradientTree::add(std::size_t slot, StepGradients& gradients) {
  sum_.push({slot, 0}, std::exchange(gradients, {}),
            [this](StepGradients& left, StepGradients& right) { join(left, right); });
  if (spare_.empty()) return;
  gradients = std::move(spare_.back());
  spare_.pop_back();
}

void GradientTree::finish(StepGradients& sum) {
  sum_.finish([this](StepGradients& left, StepGradients& right) { join(left, right); });
  if (sum_.parts().empty())
    throw UsageError("There are no gradients to add: give those of one view or more");
  spare_.push_back(std::exchange(sum, std::move(sum_.take().front().second)));
}

}  // namespace raysplats
