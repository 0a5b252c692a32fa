// SPDX-License-Identifier: Apache-2.0
#include "train/gradient_tree.hpp"

#include <span>
#include <utility>

#include "comm/slot_sum.hpp"
#include "raysplats/error.hpp"

namespace raysplats {
namespace {

constexpr std::size_t kGroup = 64;

template <class Gradients, class Visit>
void for_each_buffer(Gradients& gradients, const Visit& visit) {
  for_each_group([&](ParameterGroup, auto& buffer) { visit(buffer); }, gradients.gaussians);
  visit(gradients.gaussians.screen);
  visit(gradients.sky);
}

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
  for (auto& part : sum_.take()) spare_.push_back(std::move(part.second));
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

void GradientTree::finish(StepGradients& sum, Communicator& ranks, std::size_t slots) {
  if (ranks.size() == 1) {
    finish(sum);
    return;
  }
  const auto& parts = sum_.parts();
  rows_.resize(parts.size());
  for (std::size_t k = 0; k < parts.size(); ++k) {
    std::size_t numbers = 0;
    for_each_buffer(parts[k].second, [&](const Buffer<float>& b) { numbers += b.size(); });
    rows_[k].resize(numbers);
    std::size_t at = 0;
    for_each_buffer(parts[k].second, [&](const Buffer<float>& b) {
      b.download(std::span(rows_[k]).subspan(at, b.size()));
      at += b.size();
    });
  }
  finish(sum);  // for its buffers
  const std::vector<std::span<const float>> views(rows_.begin(), rows_.end());
  total_.resize(rows_.front().size());
  sum_slots(ranks, slots, views, total_, room_);
  std::size_t at = 0;
  for_each_buffer(sum, [&](Buffer<float>& b) {
    b.upload(std::span<const float>(total_).subspan(at, b.size()));
    at += b.size();
  });
}

}  // namespace raysplats
