// SPDX-License-Identifier: Apache-2.0
#include "train/optimizer/gradient_tree.hpp"

#include <span>
#include <utility>

#include "device/row_download.hpp"
#include "raysplats/error.hpp"
#include "train/optimizer/group_parts.hpp"

namespace raysplats {
namespace {

constexpr const char* kProgram = "train/gradient_tree.cl";
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
  BuildOptions build;
  build.define("SH_FLOATS", group_width(ParameterGroup::kSh, sh_degree_));
  if (count_ > 0) {
    const GroupParts work = group_parts(count_, sh_degree_, kGroup);
    context_.kernel(kProgram, "add_gradients", build)
        .launch(work.range, u32(count_), work.parts, right.gaussians.arguments(),
                left.gaussians.arguments());
  }
  if (right.sky.size() > 0) {
    context_.kernel(kProgram, "add_numbers", build)
        .launch(Range::linear(right.sky.size(), kGroup), right.sky, left.sky,
                static_cast<std::uint64_t>(right.sky.size()));
  }
  spare_.push_back(std::move(right));
}

void GradientTree::begin(Communicator& ranks, std::size_t slots, const DeviceGaussians& gaussians) {
  for (auto& part : sum_.take()) spare_.push_back(std::move(part.second));
  ranks_ = &ranks;
  slots_ = slots;
  count_ = gaussians.count;
  sh_degree_ = gaussians.sh_degree;
  wanted_ = ranks.size() > 1 ? SlotSum::nodes(slots, ranks.rank(), ranks.size())
                             : std::vector<PairwiseNode>();
  sent_ = 0;
}

void GradientTree::add(std::size_t slot, StepGradients& gradients) {
  sum_.push({slot, 0}, std::exchange(gradients, {}),
            [this](StepGradients& left, StepGradients& right) { join(left, right); });
  if (sent_ < wanted_.size() && sum_.parts().back().first == wanted_[sent_]) send();
  if (spare_.empty()) return;
  gradients = std::move(spare_.back());
  spare_.pop_back();
}

// The sum of a node, whose buffers are spare then: what is enqueued later comes after the copy.
void GradientTree::send() {
  StepGradients sum = sum_.take_last().second;
  std::vector<const Buffer<float>*> buffers;
  for_each_buffer(sum, [&](const Buffer<float>& buffer) { buffers.push_back(&buffer); });
  if (rows_.size() == sent_) rows_.push_back(std::make_shared<std::vector<float>>());
  const std::shared_ptr<std::vector<float>>& row = rows_[sent_];
  const auto download = std::make_shared<RowDownload>(context_, buffers, row);
  if (sent_++ == 0) among_.begin(*ranks_, slots_, row->size());
  among_.send(*row, [download] { download->wait(); });
  spare_.push_back(std::move(sum));
}

void GradientTree::wait() {
  if (sent_ > 0) among_.wait();
}

void GradientTree::finish(StepGradients& sum) {
  if (sent_ > 0) {
    total_.resize(rows_.front()->size());
    among_.finish(total_);
    std::size_t at = 0;
    for_each_buffer(sum, [&](Buffer<float>& b) {
      b.upload(std::span<const float>(total_).subspan(at, b.size()));
      at += b.size();
    });
    return;
  }
  sum_.finish([this](StepGradients& left, StepGradients& right) { join(left, right); });
  if (sum_.parts().empty())
    throw UsageError("There are no gradients to add: give those of one view or more");
  spare_.push_back(std::exchange(sum, std::move(sum_.take().front().second)));
}

}  // namespace raysplats
