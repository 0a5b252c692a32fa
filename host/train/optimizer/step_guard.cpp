// SPDX-License-Identifier: Apache-2.0
#include "train/optimizer/step_guard.hpp"

#include <array>
#include <vector>

#include "shared/train_layout.h"

namespace raysplats {
namespace {

constexpr char kProgram[] = "train/step_guard.cl";
constexpr std::size_t kItems = 64;

}  // namespace

StepGuard::StepGuard(Context& context)
    : context_(&context),
      check_(context.kernel(kProgram, "guard_loss")),
      close_(context.kernel(kProgram, "guard_close")),
      state_(context, RS_GUARD_WORDS, "step guard"),
      step_capped_(context, 2, "capped rays of a step") {
  state_.clear();
}

void StepGuard::check_loss(const ImageLoss::Partials& loss, const Buffer<std::uint32_t>& overflow) {
  check_.launch(Range{{kItems, 1, 1}, {0, 0, 0}, {}}, loss.pixel, loss.ssim, loss.pixel_sums,
                loss.ssim_sums, overflow, state_);
}

void StepGuard::count_capped(const Buffer<std::uint32_t>& capped, bool first) {
  if (first) {
    step_capped_.copy_from(capped, 2);
  } else {
    if (!add_) add_ = context_->kernel("train/gradient_tree.cl", "add_count");
    add_.launch(Range{{1, 1, 1}, {1, 1, 1}, {}}, capped, step_capped_);
  }
}

void StepGuard::close(const Buffer<std::uint32_t>& refused,
                      const Buffer<std::uint32_t>& capped,
                      std::size_t count) {
  close_.launch(Range{{1, 1, 1}, {1, 1, 1}, {}}, refused, capped, static_cast<std::uint32_t>(count),
                kLimit, state_);
}

void StepGuard::set_mark(std::uint32_t word) { state_.upload({&word, 1}); }

void StepGuard::set_step_capped(std::uint64_t rays) {
  step_capped_.upload(std::array<std::uint32_t, 2>{static_cast<std::uint32_t>(rays),
                                                   static_cast<std::uint32_t>(rays >> 32)});
}

StepGuard::Counts StepGuard::counts() const {
  const std::vector<std::uint32_t> words = state_.download();
  return {words[1], words[2], words[3] != 0, std::uint64_t{words[6]} << 32 | words[5]};
}

void StepGuard::restore(const Counts& counts) {
  const std::uint32_t stopped = counts.stopped ? 1 : 0;
  state_.upload(std::array<std::uint32_t, RS_GUARD_WORDS>{
      stopped, counts.in_a_row, counts.bad_steps, stopped, 0,
      static_cast<std::uint32_t>(counts.capped_rays),
      static_cast<std::uint32_t>(counts.capped_rays >> 32)});
}

}  // namespace raysplats
